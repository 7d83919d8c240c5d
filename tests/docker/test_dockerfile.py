"""The image: what its Dockerfile says, and its steps run in a clean folder. No container engine is needed."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docker.dockerfile import FOLDER, Instruction, environment, only, stages

ROOT = FOLDER.parent
DOCKERFILES = sorted(path for path in FOLDER.iterdir() if path.name.endswith("Dockerfile"))
HADOLINT = Path(sys.executable).with_name("hadolint")


@pytest.mark.parametrize("path", DOCKERFILES, ids=lambda path: path.name)
def test_hadolint_finds_nothing(path: Path) -> None:
    done = subprocess.run([HADOLINT, path], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (0, "")


@pytest.mark.parametrize("path", DOCKERFILES, ids=lambda path: path.name)
def test_images_have_a_version_and_run_as_nobody(path: Path) -> None:
    for stage in stages(path):
        assert re.search(r":[\w.-]*\d|:[a-z]+-slim", stage[0].words[0])
    user, group = only(stages(path)[-1], "USER").text.split(":")
    assert int(user) > 0
    assert int(group) > 0


def test_the_context_holds_what_is_copied_and_nothing_private() -> None:
    ignore = (FOLDER / "Dockerfile.dockerignore").read_text().splitlines()
    assert ignore[0] == "*"
    let_in = {line[1:] for line in ignore if line.startswith("!")}
    copied = {
        source
        for stage in stages(FOLDER / "Dockerfile")
        for each in stage
        if each.keyword == "COPY" and "from" not in each.flags
        for source in each.words[:-1]
    }
    assert copied == let_in
    assert all((ROOT / name).exists() for name in copied)


def test_the_image_tells_whether_it_is_healthy() -> None:
    health = only(stages(FOLDER / "Dockerfile")[-1], "HEALTHCHECK")
    assert {"interval", "timeout", "start-period", "retries"} == set(health.flags)
    assert "http://127.0.0.1:8080/api/v1/health" in health.text


@pytest.mark.image
@pytest.mark.timeout(900)
def test_the_images_steps_make_a_service_that_answers(tmp_path: Path) -> None:
    build, final = stages(FOLDER / "Dockerfile")
    image = Image(tmp_path)
    for stage in (build, final):
        image.build(stage)
    assert list((tmp_path / "var/cache/hsop-gcs").rglob("*.nbi")), "compiled kernels are in the image"
    state = tmp_path / "var/lib/hsop-gcs"
    assert list(state.iterdir()) == []

    # not the image's address and port, nor the fleet's ports: this machine may be using them
    fleet = (tmp_path / "etc/hsop-gcs/px4/fleet-2.toml").read_text()
    (tmp_path / "etc/hsop-gcs/FLEET.toml").write_text(re.sub(r"127\.0\.0\.1:\d+", "127.0.0.1:0", fleet))
    command = [*only(final, "ENTRYPOINT").words, *only(final, "CMD").words, "--host", "127.0.0.1", "--port", "0"]
    command[0] = str(tmp_path / "opt/hsop-gcs/bin" / command[0])
    command = [image.inside(word) for word in command]
    with subprocess.Popen(command, env=image.environment, cwd=state, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            told = next(line for line in process.stderr if line.startswith("hsop-gcs serves 2 hosts"))
            address = re.findall(r"http://[\w.]+:\d+", told)[0]
            check = Instruction("CMD", {}, only(final, "HEALTHCHECK").text.removeprefix("CMD "))
            python, *arguments = [word.replace("http://127.0.0.1:8080", address) for word in check.words]
            subprocess.run(
                [tmp_path / "opt/hsop-gcs/bin" / python, *arguments], env=image.environment, check=True, timeout=60
            )
        finally:
            process.terminate()
            process.wait(timeout=30)
    assert (state / "journal.jsonl").is_file()


class Image:
    """A folder in the place of the root of both stages: what one copies from the other keeps its path."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._workdir = root
        ours = ("PYTHONPATH", "VIRTUAL_ENV", "NUMBA_CACHE_DIR")
        self.environment = {name: value for name, value in os.environ.items() if name not in ours}
        # where the image has its python, whether or not this machine has one of that name
        programs = root / "usr/local/bin"
        programs.mkdir(parents=True)
        (programs / "python").symlink_to(Path(sys._base_executable))  # type: ignore[attr-defined]
        self.environment["PATH"] = f"{programs}:{self.environment['PATH']}"

    def build(self, stage: list[Instruction]) -> None:
        """Do what changes files; ENV holds from its line on."""
        for step in stage:
            match step.keyword:
                case "WORKDIR":
                    self._workdir = Path(self.inside(step.text))
                    self._workdir.mkdir(parents=True, exist_ok=True)
                case "ENV":
                    for name, value in environment([step]).items():
                        now = self.inside(value).replace("$PATH", self.environment["PATH"])
                        self.environment[name] = now
                case "COPY":
                    self._copy(step)
                case "RUN":
                    subprocess.run(
                        self.inside(step.text), shell=True, check=True, cwd=self._workdir, env=self.environment
                    )

    def inside(self, text: str) -> str:
        """Return the text with the image's absolute paths turned into paths of the folder."""
        return re.sub(r"(?<![\w./:])/(?=(opt|src|var|etc)\b)", f"{self._root}/", text)

    def _copy(self, step: Instruction) -> None:
        *sources, target = step.words
        if "from" in step.flags:
            assert sources == [target]
            return
        for source in sources:
            to = self._workdir / self.inside(target)
            if (ROOT / source).is_dir():
                shutil.copytree(ROOT / source, to, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(ROOT / source, to)
