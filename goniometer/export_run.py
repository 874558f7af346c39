"""What ``goniometer export`` does: a stored run for other programs, or for a rig file to name."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from goniometer.output_file import require_output


def export_run(
    run: Path, *, pbsdf: Path | None = None, event_model: Path | None = None, flat: Path | None = None
) -> tuple[str, ...]:
    """Write a stored run in every format that is asked for.

    Parameters
    ----------
    run : Path
        The run's folder.
    pbsdf : Path, optional
        A ``.pbsdf`` file for the fitted surface.
    event_model : Path, optional
        A ``.jsonl`` file for the documents of Bluesky's event model; ``-`` is the standard output.
    flat : Path, optional
        A ``.tiff`` file for the sensitivity of the camera's pixels, from a run on something evenly bright.

    Returns
    -------
    tuple of str
        What was written, for a person.

    Raises
    ------
    ConfigurationError
        If a file must not be written.
    GoniometerError
        If the run cannot be read, reduced or, for a surface, fitted.
    """
    to_stdout = event_model == Path("-")
    if pbsdf is not None:
        require_output(pbsdf, (".pbsdf",), [run])
    if event_model is not None and not to_stdout:
        require_output(event_model, (".jsonl",), [run])
    if flat is not None:
        require_output(flat, (".tiff",), [run])
    notes = []
    if pbsdf is not None:
        from goniometer.pbsdf.export import export_pbsdf

        table = export_pbsdf(run, pbsdf)
        phi_d, theta_d, theta_h = table.axes.shape
        notes.append(
            f"wrote {pbsdf}: {phi_d} x {theta_d} x {theta_h} directions (phi_d, theta_d, theta_h); between them "
            f"interpolation errs by {table.error} against F00"
        )
    if event_model is not None:
        from goniometer.bluesky.export import export_event_model

        export_event_model(run, None if to_stdout else event_model)
        if not to_stdout:
            notes.append(f"wrote {event_model}")
    if flat is not None:
        from goniometer.imaging.run_flat import flat_of_run

        made = flat_of_run(run)
        made.save(flat)
        notes.append(
            f"wrote {flat}: sensitivities within {made.spread:.1%} of their mean, {np.count_nonzero(made.is_bad)} bad "
            f"pixels, known to {made.typical_stderr:.2%} each; name it as flat of the camera in the rig file"
        )
    return tuple(notes)
