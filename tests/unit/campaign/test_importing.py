"""Taking over a campaign's archive: complete or not at all, and nothing outside of the results."""

from __future__ import annotations

import gzip
import io
import os
import shutil
import tarfile
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard
from support.faults.killing import begin_dying, deaths

from robovast.base.errors import InputError, StorageError
from robovast.campaign.archive import LEAST_ROOM
from robovast.campaign.discovery import find_campaigns
from robovast.campaign.executables import executables_of, warn_of_executables
from robovast.campaign.importing import import_archive

NAME = "my-campaign-2026-03-05-121530"


def member(name: str, content: bytes = b"", **attributes: object) -> tuple[tarfile.TarInfo, bytes]:
    info = tarfile.TarInfo(name)
    info.size = len(content)
    for key, value in attributes.items():
        setattr(info, key, value)
    return info, content


def link(name: str, target: str, kind: bytes = tarfile.SYMTYPE) -> tuple[tarfile.TarInfo, bytes]:
    return member(name, type=kind, linkname=target)


GOOD = [
    member(f"{NAME}/_config/a file.vast", b"version: 1\n"),
    member(f"{NAME}/_jobs/job-1/logs/system.log", b"\xff\xfe no text"),
    member(f"{NAME}/one-1/0/test.xml", b"<testsuite/>", mtime=1_700_000_000),
    member(f"{NAME}/one-1/0/tool", b"#!/bin/sh\n", mode=0o4755),
    link(f"{NAME}/one-1/0/job", "../../_jobs/job-1"),
]


def archive_of(
    folder: Path, *members: tuple[tarfile.TarInfo, bytes], name: str = f"{NAME}.tar.gz"
) -> Path:
    path = folder / name
    with tarfile.open(path, "w:gz") as tar:
        for info, content in members:
            tar.addfile(info, io.BytesIO(content) if info.isreg() else None)
    return path


def everything(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_a_campaign_comes_in_as_it_was(tmp_path: Path) -> None:
    campaign = import_archive(archive_of(tmp_path, *GOOD), tmp_path / "results")
    assert campaign == tmp_path / "results" / NAME
    assert (campaign / "_config" / "a file.vast").read_text() == "version: 1\n"
    assert (campaign / "one-1" / "0" / "job" / "logs" / "system.log").read_bytes()[
        :2
    ] == b"\xff\xfe"
    assert (campaign / "one-1" / "0" / "test.xml").stat().st_mtime == 1_700_000_000
    assert (campaign / "one-1" / "0" / "tool").stat().st_mode & 0o7777 == 0o755
    assert everything(tmp_path / "results") >= {NAME}
    assert [path.name for path in (tmp_path / "results").iterdir()] == [NAME]


def test_an_archive_without_the_campaigns_folder_gives_the_campaign_its_name(
    tmp_path: Path,
) -> None:
    bare = [member("./_config/x.vast"), member("one/0/test.xml"), link("one/0/job", "../../_jobs")]
    campaign = import_archive(archive_of(tmp_path, *bare, name="a name.tgz"), tmp_path / "results")
    assert everything(campaign) >= {"_config/x.vast", "one/0/test.xml", "one/0/job"}
    assert campaign.name == "a name"


def test_hard_links_become_files(tmp_path: Path) -> None:
    hard = link(f"{NAME}/one-1/0/copy", f"{NAME}/one-1/0/test.xml", tarfile.LNKTYPE)
    campaign = import_archive(archive_of(tmp_path, *GOOD, hard), tmp_path / "results")
    assert (campaign / "one-1" / "0" / "copy").read_text() == "<testsuite/>"


def test_a_zip_file_keeps_its_links(tmp_path: Path) -> None:
    path = tmp_path / "x.zip"
    with zipfile.ZipFile(path, "w") as zipped:
        zipped.writestr(f"{NAME}/_config/x.vast", "")
        info = zipfile.ZipInfo(f"{NAME}/one/0/job")
        info.external_attr = 0o120777 << 16
        zipped.writestr(info, "../../_jobs/job-1")
    campaign = import_archive(path, tmp_path / "results")
    assert (campaign / "one" / "0" / "job").readlink() == Path("../../_jobs/job-1")


def test_a_tar_file_that_ends_with_a_zip_file_is_a_tar_file(tmp_path: Path) -> None:
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w") as zipped:
        zipped.writestr("other/one/0/test.xml", "")
    last = member(f"{NAME}/one/0/x.npz", inner.getvalue())
    plain = tmp_path / "x.tar"
    plain.write_bytes(gzip.decompress(archive_of(tmp_path, *GOOD, last).read_bytes()))
    campaign = import_archive(plain, tmp_path / "results")
    assert campaign.name == NAME
    assert (campaign / "one/0/x.npz").read_bytes() == inner.getvalue()


MALICIOUS = {
    "an absolute name": [member("/tmp/evil")],
    "a name that climbs": [member(f"{NAME}/../../evil")],
    "an absolute link": [link(f"{NAME}/evil", "/etc/passwd")],
    "a link that climbs": [link(f"{NAME}/one-1/evil", "../../../evil")],
    "a link to another campaign": [link(f"{NAME}/evil", "../other-campaign/secret")],
    "links that climb together": [
        link(f"{NAME}/a/b/here", "../.."),
        link(f"{NAME}/evil", "a/b/here/.."),
    ],
    "a file through a link": [link(f"{NAME}/evil", "_jobs"), member(f"{NAME}/evil/x", b"x")],
    "a hard link out": [link(f"{NAME}/evil", "../../../etc/passwd", tarfile.LNKTYPE)],
    "a device": [member(f"{NAME}/evil", type=tarfile.CHRTYPE)],
    "a pipe": [member(f"{NAME}/evil", type=tarfile.FIFOTYPE)],
    "a name that comes twice": [member(f"{NAME}/evil"), member(f"{NAME}/evil")],
    "a folder that is a file": [member(f"{NAME}/evil"), member(f"{NAME}/evil/x")],
}


@pytest.mark.parametrize("what", MALICIOUS)
def test_a_malicious_archive_leaves_nothing(tmp_path: Path, what: str) -> None:
    archive = archive_of(tmp_path, *GOOD, *MALICIOUS[what])
    (tmp_path / "results").mkdir()
    with pytest.raises(InputError):
        import_archive(archive, tmp_path / "results")
    assert everything(tmp_path) == {archive.name, "results"}


@pytest.mark.parametrize(
    "name", ["_config", "_execution", "_transient", "_jobs", "_x", ".x", ".running"]
)
def test_a_campaign_cannot_have_the_name_of_a_folder_in_campaigns(
    tmp_path: Path, name: str
) -> None:
    inside = archive_of(tmp_path, member(f"{name}/_config/x.vast"), name="x.tar.gz")
    bare = [member("_config/x.vast"), member("one/0/test.xml")]
    named = archive_of(tmp_path, *bare, name=f"{name}.tar.gz")
    for archive in (inside, named):
        with pytest.raises(InputError, match="cannot begin with"):
            import_archive(archive, tmp_path / "results")
    assert not (tmp_path / "results" / name).exists()


@pytest.mark.parametrize("number", ["00", "007", "1234567890", "٣"])
def test_two_folders_cannot_have_one_run_number(tmp_path: Path, number: str) -> None:
    archive = archive_of(tmp_path, *GOOD, member(f"{NAME}/one-1/{number}/test.xml"))
    with pytest.raises(InputError, match=f"`one-1/{number}` cannot be the folder of a run"):
        import_archive(archive, tmp_path / "results")
    assert everything(tmp_path) == {archive.name, "results"}


def pax(kind: bytes) -> bytes:
    return header(kind, pax_record(b"key", b"a" * 16_000))


def pax_record(key: bytes, value: bytes) -> bytes:
    rest = b" " + key + b"=" + value + b"\n"
    length = next(n for n in range(len(rest), len(rest) + 9) if n == len(rest) + len(str(n)))
    return str(length).encode() + rest


def header(kind: bytes, content: bytes) -> bytes:
    info = tarfile.TarInfo("header")
    info.type, info.size = kind, len(content)
    return info.tobuf(tarfile.USTAR_FORMAT) + content + bytes(-len(content) % 512)


@pytest.mark.parametrize(
    "metadata",
    [pax(tarfile.XHDTYPE), pax(tarfile.XGLTYPE), header(tarfile.GNUTYPE_LONGLINK, b"a" * 16_000)],
)
def test_metadata_that_explodes_is_refused_in_little_memory(
    tmp_path: Path, metadata: bytes
) -> None:
    archive = tmp_path / f"{NAME}.tar.gz"
    with gzip.open(archive, "wb") as file:
        for number in range(5000):
            file.write(metadata + member(f"{NAME}/f{number}")[0].tobuf())
        file.write(bytes(1024))
    tracemalloc.start()
    with pytest.raises(InputError, match=r"unpacks to more than|a header of"):
        import_archive(archive, tmp_path / "results")
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2**25
    assert not list((tmp_path / "results").glob("*"))


def test_hard_links_to_links_and_to_nothing(tmp_path: Path) -> None:
    job = link(f"{NAME}/one-1/0/twin", f"{NAME}/one-1/0/job", tarfile.LNKTYPE)
    campaign = import_archive(archive_of(tmp_path, *GOOD, job), tmp_path / "results")
    assert (campaign / "one-1/0/twin").readlink() == Path("../../_jobs/job-1")
    for target in (f"{NAME}/later", f"{NAME}/one-1", "/etc/passwd", "../x", "a\0b"):
        bad = link(f"{NAME}/bad", target, tarfile.LNKTYPE)
        archive = archive_of(tmp_path, *GOOD, bad, member(f"{NAME}/later"))
        with pytest.raises(InputError):
            import_archive(archive, tmp_path / "others")


@pytest.mark.parametrize("suffix", ["zip", "tar.gz", "tar.bz2", "tar.xz"])
def test_archives_with_a_missing_part_are_damaged(tmp_path: Path, suffix: str) -> None:
    whole = tmp_path / NAME / "_config"
    whole.mkdir(parents=True)
    for number in range(9):
        (whole / f"{number}.vast").write_bytes(os.urandom(3000))
    kind = {"tar.gz": "gztar", "tar.bz2": "bztar", "tar.xz": "xztar"}.get(suffix, suffix)
    packed = shutil.make_archive(str(tmp_path / "x"), kind, tmp_path, base_dir=NAME)
    content = Path(packed).read_bytes()
    archive = tmp_path / f"cut.{suffix}"
    size = len(content)
    for begin, end in ((size // 2, size * 2 // 3), (10, 900), (0, 900), (size // 3, size - 600)):
        archive.write_bytes(content[:begin] + content[end:])
        with pytest.raises(InputError, match=r"damaged|contains no campaign"):
            import_archive(archive, tmp_path / "results", force=True)


def test_a_link_alone_is_no_campaign(tmp_path: Path) -> None:
    (tmp_path / "other" / "_config").mkdir(parents=True)
    archive = archive_of(tmp_path, link("evil", "../../../other"))
    with pytest.raises(InputError, match="contains no campaign"):
        import_archive(archive, tmp_path / "results")


@pytest.mark.parametrize("keep", [0, 10, 200, -1, -12])
def test_an_incomplete_archive_is_refused(tmp_path: Path, keep: int) -> None:
    archive = archive_of(tmp_path, *GOOD)
    archive.write_bytes(archive.read_bytes()[:keep])
    with pytest.raises(InputError, match="damaged or incomplete"):
        import_archive(archive, tmp_path / "results")
    assert list((tmp_path / "results").iterdir()) == []


def test_a_pipe_or_a_device_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.tgz")
    (tmp_path / "b.tgz").symlink_to("/dev/zero")
    for name in ("a.tgz", "b.tgz"):
        with pytest.raises(InputError, match="is not a regular file"):
            import_archive(tmp_path / name, tmp_path / "results")


def test_a_file_of_another_kind_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no archive\n" * 100)
    with pytest.raises(InputError) as caught:
        import_archive(tmp_path / "notes.txt", tmp_path / "results")
    assert "(it does not begin like a tar or zip file). Download it again." in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_holds_no_campaign_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="contains no campaign, but a, b"):
        import_archive(archive_of(tmp_path, member("a"), member("b")), tmp_path / "results")
    with pytest.raises(InputError, match="No such file"):
        import_archive(tmp_path / "missing.tar.gz", tmp_path / "results")


def test_a_campaign_with_a_name_of_unfinished_work_is_refused(tmp_path: Path) -> None:
    archive = archive_of(tmp_path, member(".other.part/_config/x.vast"))
    with pytest.raises(InputError, match="cannot begin with"):
        import_archive(archive, tmp_path / "results")
    assert list((tmp_path / "results").iterdir()) == []


def test_notes_of_another_machine_are_dropped(tmp_path: Path) -> None:
    """`.bucket` would let a page remove the campaign, `.running` would show it as running."""
    notes = (".bucket", ".running", ".omitted/deep/x", ".download/x", ".aside/0/x")
    archive = archive_of(tmp_path, *GOOD, *(member(f"{NAME}/{note}") for note in notes))
    campaign = import_archive(archive, tmp_path / "results")
    hidden = {path.name for path in campaign.iterdir() if path.name.startswith(".")}
    assert hidden == {".imported", ".aside"}


@pytest.mark.parametrize("name", ["x\x1b[2J", "x\nall passed", "x\u202e", "x\x9b31m"])
def test_a_name_that_terminals_obey_is_refused_and_shown_safely(tmp_path: Path, name: str) -> None:
    for place in (f"{name}/_config/x.vast", f"{NAME}/{name}/0/test.xml"):
        others = GOOD if place.startswith(NAME) else []
        archive = archive_of(tmp_path, *others, member(place))
        with pytest.raises(InputError, match="contains control characters") as caught:
            import_archive(archive, tmp_path / "results")
        assert name not in str(caught.value)
    assert list((tmp_path / "results").iterdir()) == []


def test_a_campaign_that_is_here_is_replaced_on_demand_only(tmp_path: Path) -> None:
    archive = archive_of(tmp_path, *GOOD)
    kept = tmp_path / "results" / NAME / "mine"
    kept.parent.mkdir(parents=True)
    kept.touch()
    with pytest.raises(StorageError, match="exists already"):
        import_archive(archive, tmp_path / "results")
    assert kept.exists()
    import_archive(archive, tmp_path / "results", force=True)
    assert not kept.exists()
    assert [path.name for path in (tmp_path / "results").iterdir()] == [NAME]


def test_wherever_it_is_killed_the_old_campaign_is_there_or_the_new(tmp_path: Path) -> None:
    archive = archive_of(tmp_path, *GOOD)

    def replace(place: Path) -> None:
        old = place / "results" / NAME / "_config" / "old.vast"
        old.parent.mkdir(parents=True)
        old.touch()
        begin_dying()
        import_archive(archive, place / "results", force=True)

    seen = []
    for number, place in deaths(tmp_path / "places", replace):
        (campaign,) = find_campaigns(place / "results")
        seen.append([path.name for path in (campaign / "_config").iterdir()])
        if not number % 20:
            import_archive(archive, place / "results", force=True)
            assert [path.name for path in (place / "results").iterdir()] == [NAME]
    assert seen == sorted(seen, reverse=True)
    assert [seen[0], seen[-1]] == [["old.vast"], ["a file.vast"]]


@pytest.mark.parametrize("links", [{"a": "a"}, {"a": "b", "b": "a"}, {"a/x": "../b", "b": "a/x/y"}])
def test_links_in_a_circle_are_refused(tmp_path: Path, links: dict[str, str]) -> None:
    archive = archive_of(tmp_path, *GOOD, *(link(f"{NAME}/{a}", b) for a, b in links.items()))
    with pytest.raises(InputError, match="in a circle"):
        import_archive(archive, tmp_path / "results")
    assert list((tmp_path / "results").iterdir()) == []


BOMBS = {
    "one large file": [member(f"{NAME}/big", bytes(LEAST_ROOM + 1))],
    "many files": [member(f"{NAME}/{n}", bytes(2**20)) for n in range((LEAST_ROOM >> 20) + 1)],
}


@pytest.mark.parametrize("what", BOMBS)
def test_an_archive_that_would_fill_the_disk_is_refused(tmp_path: Path, what: str) -> None:
    archive = archive_of(tmp_path, *GOOD, *BOMBS[what])
    with pytest.raises(InputError, match="unpacks to more than 64 MiB, 200 times its size"):
        import_archive(archive, tmp_path / "results")
    assert list((tmp_path / "results").iterdir()) == []


def test_a_zip_file_that_lies_of_its_size_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as zipped:
        zipped.writestr(f"{NAME}/_config/x.vast", "")
        zipped.writestr(f"{NAME}/big", bytes(LEAST_ROOM + 1))
    with pytest.raises(InputError, match="unpacks to more"):
        import_archive(path, tmp_path / "results")


def test_a_link_of_gigabytes_takes_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "x.zip"
    entry = zipfile.ZipInfo(f"{NAME}/link")
    entry.external_attr, entry.compress_type = 0o120777 << 16, zipfile.ZIP_DEFLATED
    with zipfile.ZipFile(path, "w") as zipped:
        zipped.writestr(f"{NAME}/_config/x.vast", "")
        with zipped.open(entry, "w") as file:
            for _ in range(256):
                file.write(b"x" * 2**20)
    tracemalloc.start()
    with pytest.raises(StorageError, match="a name is too long"):
        import_archive(path, tmp_path / "results")
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 2**25


@pytest.mark.parametrize("kind", [tarfile.XHDTYPE, tarfile.GNUTYPE_LONGNAME])
def test_a_header_of_gigabytes_takes_no_memory(tmp_path: Path, kind: bytes) -> None:
    path = tmp_path / f"{NAME}.tar.gz"
    header = tarfile.TarInfo("header")
    header.type, header.size = kind, 2**28
    with gzip.open(path, "wb", 1) as file:
        file.write(tarfile.TarInfo("first").tobuf() + header.tobuf(tarfile.GNU_FORMAT))
        for _ in range(256):
            file.write(bytes(2**20))
    tracemalloc.start()
    with pytest.raises(InputError, match="a header of 268435456 bytes"):
        import_archive(path, tmp_path / "results")
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 2**25


@pytest.mark.parametrize("time", ["nan", "inf", "1e30", "-1e30"])
def test_a_time_that_no_disk_knows_is_left_out(tmp_path: Path, time: str) -> None:
    odd = member(f"{NAME}/one-1/0/odd", b"x", pax_headers={"mtime": time})
    campaign = import_archive(archive_of(tmp_path, *GOOD, odd), tmp_path / "results")
    assert (campaign / "one-1/0/odd").read_bytes() == b"x"


def test_what_a_campaign_brings_that_is_executed_is_told(tmp_path: Path) -> None:
    document = b"""
configuration:
- {name: one, variations: [{"files/noise.py:Noise": {sigma: 1}}, {ParameterVariationList: {}}]}
results_processing:
  postprocessing: [rosbags_to_csv, {command: {script: ./steal.sh}}, "mine.py:main"]
  metadata_processing: ["facts.py:Facts"]
analysis: {postprocessing: 7}
---
more: 1
"""
    config = f"{NAME}/_config"
    files = [member(f"{config}/x.vast", document), member(f"{config}/a/look.ipynb", b"{}")]
    campaign = import_archive(archive_of(tmp_path, *files), tmp_path / "results")
    assert executables_of(campaign) == [
        "command `./steal.sh`",
        "notebook `a/look.ipynb`",
        "plugin `facts.py:Facts`",
        "plugin `files/noise.py:Noise`",
        "plugin `mine.py:main`",
    ]
    warning = warn_of_executables(campaign)
    assert warning is not None
    assert "--no-plugins" in warning


@pytest.mark.parametrize(
    "document", [b"", b"[", b"- 1", b"configuration: {a: 1}", b"\xff\xfe", b"&a [*a]"]
)
def test_a_document_that_nobody_can_read_executes_nothing(tmp_path: Path, document: bytes) -> None:
    archive = archive_of(tmp_path, member(f"{NAME}/_config/x.vast", document))
    assert warn_of_executables(import_archive(archive, tmp_path / "results")) is None


def test_an_archive_of_several_campaigns_is_refused(tmp_path: Path) -> None:
    other = [member(f"other/{n}", c) for n, c in [("_config/a.vast", b""), ("a/0/test.xml", b"")]]
    with pytest.raises(InputError, match=rf"contains 2 campaigns \({NAME}, other\)"):
        import_archive(archive_of(tmp_path, *GOOD, *other), tmp_path / "results")
    assert everything(tmp_path / "results") == set()


@pytest.mark.parametrize("compress", [bytes, gzip.compress])
def test_archives_in_one_file_are_refused(
    tmp_path: Path, compress: Callable[[bytes], bytes]
) -> None:
    plain = gzip.decompress(archive_of(tmp_path, *GOOD).read_bytes())
    path = tmp_path / "both.tar"
    path.write_bytes(compress(plain + plain))
    with pytest.raises(InputError, match="has more content after the end of its archive"):
        import_archive(path, tmp_path / "results")
    assert everything(tmp_path / "results") == set()


def test_kinds_of_archives_that_are_not_supported_have_a_remedy(tmp_path: Path) -> None:
    plain = gzip.decompress(archive_of(tmp_path, *GOOD).read_bytes())
    packed = tmp_path / "x.tar.zst"
    packed.write_bytes(zstandard.compress(plain))
    with pytest.raises(InputError, match=r"is compressed with zstd.*`zstd -d .*x\.tar\.zst`"):
        import_archive(packed, tmp_path / "results")
    locked = tmp_path / "x.zip"
    with zipfile.ZipFile(locked, "w") as zipped:
        zipped.writestr(f"{NAME}/one/0/test.xml", "<testsuite/>")
    content = bytearray(locked.read_bytes())
    for signature, flags in [(b"PK\3\4", 6), (b"PK\1\2", 8)]:
        content[content.index(signature) + flags] |= 1  # says that it is encrypted
    locked.write_bytes(content)
    with pytest.raises(InputError, match=r"is encrypted\. Unpack it with its password"):
        import_archive(locked, tmp_path / "results")
