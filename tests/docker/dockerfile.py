"""The instructions of a Dockerfile, as much of its grammar as ours use."""

import json
import re
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "docker"


@dataclass(frozen=True)
class Instruction:
    """One instruction: its keyword, its ``--name=value`` flags and the rest of its line."""

    keyword: str
    flags: dict[str, str]
    text: str

    @property
    def words(self) -> list[str]:
        """The rest as words: from the JSON form if it is one."""
        if not self.text.startswith("["):
            return self.text.split()
        words: list[str] = json.loads(self.text)
        return words


def stages(path: Path) -> list[list[Instruction]]:
    """Return the instructions of each stage, FROM first."""
    found: list[list[Instruction]] = []
    for line in re.sub(r"\\\n\s*", "", path.read_text()).splitlines():
        if not line or line.startswith("#"):
            continue
        keyword, rest = line.split(maxsplit=1)
        text = re.sub(r"^(--[a-z-]+=\S+\s+)*", "", rest)
        flags = dict(re.findall(r"--([a-z-]+)=(\S+)", rest.removesuffix(text)))
        if keyword == "FROM":
            found.append([])
        found[-1].append(Instruction(keyword, flags, text))
    return found


def only(stage: list[Instruction], keyword: str) -> Instruction:
    """Return the stage's one instruction with this keyword."""
    (instruction,) = [each for each in stage if each.keyword == keyword]
    return instruction


def environment(stage: list[Instruction]) -> dict[str, str]:
    """Return what the ENV instructions of a stage set."""
    return dict(word.split("=", 1) for each in stage if each.keyword == "ENV" for word in each.words)
