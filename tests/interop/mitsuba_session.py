"""Mitsuba reads a .pbsdf file and evaluates it: ``mitsuba_session.py FILE DIRECTIONS`` prints Mueller matrices as JSON.

DIRECTIONS is a JSON list of incidence, exit and azimuth in rad. The variant of scalars needs no compiler.
"""

import json
import sys

import mitsuba
import numpy as np

mitsuba.set_variant("scalar_spectral_polarized")


def unit_vector(polar, azimuth):
    return mitsuba.Vector3f(np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar))


def s_direction(ray):
    return mitsuba.Vector3f(-ray.y, ray.x, 0.0) / np.hypot(ray.x, ray.y)  # z × ray


def main():
    material = mitsuba.load_dict({"type": "measured_polarized", "filename": sys.argv[1]})
    context, interaction = mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
    interaction.wavelengths = [450.0, 512.0, 550.0, 650.0]
    found = []
    for incidence, exit_, azimuth in json.loads(sys.argv[2]):
        # Mitsuba follows rays from the camera: light comes from where its "outgoing" direction points
        source, detector = unit_vector(incidence, 0.3), unit_vector(exit_, 0.3 + azimuth)
        interaction.wi = detector
        matrix = material.eval(context, interaction, source)
        bases = mitsuba.mueller.stokes_basis(-source), mitsuba.mueller.stokes_basis(detector)
        turned = mitsuba.mueller.rotate_mueller_basis(
            matrix, -source, bases[0], s_direction(-source), detector, bases[1], s_direction(detector)
        )
        per_wavelength = np.moveaxis(np.array(turned), -1, 0)
        assert np.ptp(per_wavelength, axis=0).max() <= 1e-6 * abs(per_wavelength).max()
        found.append((per_wavelength[0] / np.cos(incidence)).tolist())  # it multiplies by the cosine at the light
    print(json.dumps(found))


if __name__ == "__main__":
    main()
