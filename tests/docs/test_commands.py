"""The commands and parameters named in the documentation exist."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from app.cli import COMMANDS, _parse
from pipeline.params import Params
from pipeline.params import flat as flat_params
from tests.docs.pages import FILES, ROOT, block_commands, code_spans, span_commands
from tests.docs.reference_pages import commands, parser_of
from tests.pipeline.types.test_result_json import FIELDS

PARAMETER = re.compile(r"([a-z_]+)\.([a-z0-9_]+)")
FILE_ENDINGS = {"py", "md", "yaml", "yml", "db", "js", "onnx", "mcap", "pcap", "json", "csv"}


@pytest.mark.parametrize("file", FILES)
def test_every_command_of_a_code_block_parses(file: str) -> None:
    for words in block_commands(file):
        command = _parse(words)
        assert callable(command), words


@pytest.mark.parametrize("file", FILES)
def test_every_command_in_a_sentence_exists_with_its_options(file: str) -> None:
    wrong = [words for words in span_commands(file) if not exists(words)]
    assert wrong == []


def exists(words: list[str]) -> bool:
    if not words or words[0].isupper():
        return True  # the program, or a word for any command
    names = {*commands(), *COMMANDS}
    name = next((typed for n in (2, 1) if (typed := " ".join(words[:n])) in names), None)
    if name is None:
        return words == ["--version"] and callable(_parse(words))
    known = {option for action in parser_of(name)._actions for option in action.option_strings}
    return all(word.partition("=")[0] in known for word in words if word.startswith("--"))


@pytest.mark.parametrize("file", FILES)
def test_every_parameter_exists(file: str) -> None:
    known = set(flat_params(Params()))
    wrong = [name for name in parameters(file) if name not in known]
    assert wrong == []


def parameters(file: str) -> Iterator[str]:
    """Texts that look like parameters: in backticks, and after ``--set``."""
    for span in code_spans(file):
        match = PARAMETER.fullmatch(span)
        if not match or match[1] not in Params.model_fields or match[2] in FILE_ENDINGS:
            continue
        if match[2] not in FIELDS.get(match[1], "").split():  # a field of the result, such as path.carried_by
            yield span
    for match in re.finditer(r"--set ([a-z_]+\.[a-z0-9_]+)=", (ROOT / file).read_text(encoding="utf-8")):
        yield match[1]
