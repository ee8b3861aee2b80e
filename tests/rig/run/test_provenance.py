"""A run records the commit of the product's own checkout, and nobody else's."""

import subprocess
from importlib.metadata import version

import pytest

from rig.run.provenance import provenance

INSTALLED = {
    "code": f"swayless {version('swayless')}",
    "git_commit": "unknown",
    "git_dirty": "unknown",
}


def git(folder, *words):
    """Run git with an identity of its own."""
    identity = ["-c", "user.name=test", "-c", "user.email=test@example.invalid"]
    command = ["git", "-C", str(folder), *identity, *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def checkout(folder, project_name):
    """A git repository with one commit and a pyproject.toml of that name."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "pyproject.toml").write_text(f'[project]\nname = "{project_name}"\n')
    git(folder, "init", "-q")
    git(folder, "add", ".")
    git(folder, "commit", "-q", "-m", "first")
    return git(folder, "rev-parse", "HEAD")


def test_the_own_checkout_gives_its_commit(tmp_path):
    commit = checkout(tmp_path, "swayless")
    found = provenance(tmp_path)
    assert found == {"code": f"git {commit}", "git_commit": commit, "git_dirty": "false"}


def test_an_uncommitted_change_is_recorded(tmp_path):
    commit = checkout(tmp_path, "swayless")
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "swayless"\nversion = "1"\n')
    assert provenance(tmp_path)["git_dirty"] == "true"
    assert provenance(tmp_path)["git_commit"] == commit


@pytest.mark.parametrize("place", [".", "venv/lib/site-packages"])
def test_a_package_inside_another_checkout_is_named_by_its_version(tmp_path, place):
    checkout(tmp_path, "somebody-elses-project")
    inside = tmp_path / place
    inside.mkdir(parents=True, exist_ok=True)
    assert provenance(inside) == INSTALLED


def test_a_checkout_without_commit_or_with_a_broken_project_file_is_named_by_its_version(tmp_path):
    git(tmp_path, "init", "-q")
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "swayless"\n')
    assert provenance(tmp_path) == INSTALLED
    (tmp_path / "pyproject.toml").write_text("[project\n")
    assert provenance(tmp_path) == INSTALLED
