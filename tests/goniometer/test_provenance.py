"""What a run remembers of where it comes from."""

import getpass
import hashlib
import os
import shutil
import socket
import subprocess
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pytest

from goniometer.load_files import load_recipe
from goniometer.provenance import git_state, provenance

ROOT = Path(__file__).resolve().parents[2]
BEGUN = datetime(2026, 3, 1, 12, 0, tzinfo=timezone(timedelta(hours=1)))


@pytest.fixture
def git(tmp_path, monkeypatch):
    """Runs git in a new working tree, with nobody's settings."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")
    tree = tmp_path / "tree"
    tree.mkdir()

    def run(*arguments):
        who = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
        done = subprocess.run(["git", *who, *arguments], cwd=tree, check=True, capture_output=True, text=True)
        return done.stdout.strip()

    run("init", "--quiet")
    return tree, run


@pytest.fixture
def recipe(git):
    tree, _ = git
    for folder in ("recipes", "rigs", "scenes"):
        (tree / folder).mkdir()
    for name in ("recipes/iron_60deg.yaml", "rigs/simulated.yaml", "scenes/iron.yaml"):
        shutil.copy(ROOT / name, tree / name)
    return tree / "recipes" / "iron_60deg.yaml"


def test_texts_hashes_who_when_and_where(recipe):
    setup = load_recipe(recipe)
    about = provenance(setup, setup.scene_text, BEGUN)
    for name, path in (
        ("recipe", recipe),
        ("rig", recipe.parents[1] / "rigs" / "simulated.yaml"),
        ("scene", recipe.parents[1] / "scenes" / "iron.yaml"),
    ):
        assert about[name] == path.read_text(encoding="utf-8")
        assert about[f"{name}_sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert about["started"] == "2026-03-01T12:00:00+01:00"
    assert about["host"] == socket.gethostname()
    assert about["user"] == getpass.getuser()
    assert about["recipe_file"] == str(recipe.resolve())
    assert {"goniometer", "numpy", "scipy", "pyserial", "python", "platform"} <= about.keys()
    assert all(isinstance(text, str) and text for text in about.values())


def test_a_real_sample_has_no_scene_to_hash(recipe):
    about = provenance(load_recipe(recipe), "", BEGUN)
    assert about["scene"] == ""
    assert "scene_sha256" not in about


def test_the_state_of_a_working_tree(git, recipe):
    _, run = git
    assert git_state(recipe) == "(not under version control)"
    run("add", ".")
    run("commit", "--quiet", "-m", "first")
    commit = run("rev-parse", "HEAD")
    assert git_state(recipe) == commit
    (recipe.parent / "another.yaml").write_text("new")
    assert git_state(recipe) == commit  # a file that nobody asked for is not the recipe's state
    assert git_state(recipe.parent / "another.yaml") == "(not under version control)"
    recipe.write_text(recipe.read_text(encoding="utf-8") + "# changed\n", encoding="utf-8")
    assert git_state(recipe) == f"{commit}-dirty"
    assert git_state(recipe.parent) == f"{commit}-dirty"


def test_the_environment_of_a_hook_does_not_mislead(git, recipe, monkeypatch):
    _, run = git
    run("add", ".")
    run("commit", "--quiet", "-m", "first")
    commit = run("rev-parse", "HEAD")
    monkeypatch.setenv("GIT_DIR", "/nowhere")
    assert git_state(recipe) == commit


def test_what_git_cannot_say_is_said(tmp_path, git, recipe, monkeypatch):
    assert git_state(tmp_path) == "(not under version control)"
    (tmp_path / "empty").mkdir()
    tree, run = git
    run("add", ".")
    assert git_state(recipe).startswith("(git failed: ")  # there is no commit yet
    monkeypatch.setenv("PATH", str(tmp_path / "empty"))
    assert git_state(tree) == "(git is not installed)"
    monkeypatch.setenv("PATH", os.devnull)
    assert git_state(tree).startswith("(git cannot be run: ")
