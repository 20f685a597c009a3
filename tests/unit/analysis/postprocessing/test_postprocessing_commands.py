from __future__ import annotations

from pathlib import Path

import pytest

from robovast.analysis.postprocessing.commands import read_calls, resolve, skipped
from robovast.base.errors import DocumentError, InputError
from robovast.model.document.section import PluginCall


def keys(folder: Path, *calls: PluginCall) -> list[str]:
    return [command.key for command in resolve(calls, folder)]


def test_both_spellings_are_read_and_all_else_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.vast"
    path.write_text(
        "version: 7\nunknown: {key: 1}\n"
        "results_processing: {postprocessing: [one, two: {a: 1}], other: 1}\n"
        "analysis: {postprocessing: [./m.py:three]}\n"
    )
    calls = read_calls(path)
    assert [(c.name, c.parameters) for c in calls] == [
        ("one", {}),
        ("two", {"a": 1}),
        ("./m.py:three", {}),
    ]


def test_a_wrong_command_is_reported_with_its_place(tmp_path: Path) -> None:
    path = tmp_path / "a.vast"
    path.write_text("version: 1\nresults_processing:\n  postprocessing:\n  - [one]\n")
    with pytest.raises(DocumentError, match=r"a\.vast:4:5: results_processing\.postprocessing"):
        read_calls(path)


def test_a_key_knows_parameters_code_and_named_files(tmp_path: Path) -> None:
    plugin, script = tmp_path / "m.py", tmp_path / "s.sh"
    plugin.write_text("def f(): ...")
    script.write_text("true")
    call = PluginCall(name="m.py:f", parameters={"args": ["s.sh"]})
    first = keys(tmp_path, call)
    assert keys(tmp_path, call) == first
    assert keys(tmp_path, PluginCall(name="m.py:f", parameters={"args": ["t.sh"]})) != first
    script.write_text("false")
    second = keys(tmp_path, call)
    assert second != first
    plugin.write_text("def f(): pass")
    assert keys(tmp_path, call) != second


def test_a_key_covers_the_commands_before_but_those_of_bags_need_none(tmp_path: Path) -> None:
    tf = PluginCall(name="rosbags_tf_to_csv", parameters={"frames": ["a"]})
    other_tf = PluginCall(name="rosbags_tf_to_csv", parameters={"frames": ["b"]})
    tree, command = PluginCall(name="rosbags_bt_to_csv"), PluginCall(name="command")
    one = keys(tmp_path, tf, command, tree)
    two = keys(tmp_path, other_tf, command, tree)
    assert one[1] == two[1], "of the behaviour tree"
    assert one[2] != two[2], "of the command, which comes after all bags"


def test_commands_for_bags_stand_where_the_first_stands(tmp_path: Path) -> None:
    names = ["command", "rosbags_bt_to_csv", "compress", "rosbags_tf_to_csv"]
    commands = resolve([PluginCall(name=name) for name in names], tmp_path)
    order = ["command", "rosbags_bt_to_csv", "rosbags_tf_to_csv", "compress"]
    assert [command.name for command in commands] == order
    other = PluginCall(name="command", parameters={"script": "other"})
    changed = keys(tmp_path, other, *(PluginCall(name=name) for name in names[1:]))
    assert changed[1] != commands[1].key, "it may read what the command before has made"


def test_a_command_that_stands_twice_is_called_once(tmp_path: Path) -> None:
    assert (
        len(
            keys(
                tmp_path, PluginCall(name="rosbags_bt_to_csv"), PluginCall(name="rosbags_bt_to_csv")
            )
        )
        == 1
    )


def test_skipping_takes_names_and_short_names() -> None:
    calls = [PluginCall(name="command"), PluginCall(name="tools/m.py:Metrics")]
    assert skipped(calls, ["Metrics"]) == calls[:1]
    assert skipped(calls, ["tools/m.py:Metrics", "command"]) == []
    with pytest.raises(InputError, match=r"no such command. Use one of `command`"):
        skipped(calls, ["metrics"])
