"""Campaigns on a real cluster: the same runs, files and verdicts as on a laptop."""

from __future__ import annotations

import json
import os
import re
import subprocess
import urllib.request
from pathlib import Path
from typing import Any

import yaml
from robovast_testbed import containerd, images, programs
from support.campaigns.local import (
    make_campaign,
    verdicts,
)
from support.campaigns.local import run as run_here
from support.kube.held_runs import HELD, release_until_finished
from support.kube.lab import QUICK, SYSTEM, VAST, Lab, buckets, files
from support.patience import eventually
from support.servers.notices import POD_PORT, receiver_pod

DESIGN = """
  - ParameterVariationList: {name: text, values: [a, b, c, d]}
  design: {kind: lhs, count: 4, seed: 1}"""

GROWTH = Path(__file__).parents[2] / "configs/examples/growth_sim/growth_sim.vast"
FEW = ("-c", "fixed", "-c", "sweep-1-1", "-c", "sweep-4-3")


def test_growth_sim_gives_the_same_results_by_client_by_kubectl_and_on_this_machine(
    lab: Lab, tmp_path: Path
) -> None:
    """Two campaigns in parallel, one by `vast`, one by `kubectl apply` with inline files."""
    printed = lab.vast(
        *("-V", GROWTH, "exec", "cluster", "run", "-n", lab.namespace, "--dry-run"),
        *("-r", 1, "--image", images.SLIM, "--parallelism", 4, *FEW),
    ).stdout
    campaign = yaml.safe_load(printed)
    campaign["metadata"]["name"] = "by-kubectl"
    lab.kubectl("apply", "--filename=-", stdin=json.dumps(campaign))
    run = subprocess.Popen(
        [
            *(VAST, "-V", GROWTH, "exec", "cluster", "run"),
            *("-n", lab.namespace, "-r", "1", "--image", images.SLIM, "--parallelism", "4", *FEW),
        ],
        env=os.environ | lab.env,
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    lab.vast(
        *("-V", GROWTH, "exec", "local", "run", "--runtime", "process", "-r", 1, *FEW),
        tmp_path / "local",
    )
    (mine,) = (tmp_path / "local").glob("growth-sim-*")
    followed, _ = run.communicate(timeout=300)
    assert run.returncode == 0, followed
    lab.wait("by-kubectl")
    seen = lab.vast("exec", "cluster", "monitor", "--once", "-n", lab.namespace).stdout
    names = [item["metadata"]["name"] for item in lab.get("campaigns")["items"]]
    assert len(names) == 2
    assert all(name in seen for name in names)
    for name in names:
        theirs = lab.download(name)
        assert lab.verdicts(theirs) == lab.verdicts(mine)
        assert len(lab.verdicts(mine)) == 3
        assert files(theirs) == files(mine)
        status = lab.campaign(name)["status"]
        assert status["progress"] == "3/3"
        assert lab.conditions(name)["Passed"]["status"] == "True"


def test_of_a_design_of_which_one_value_was_edited_one_run_is_executed(
    lab: Lab, tmp_path: Path
) -> None:
    """Four of sixteen combinations, in which each value occurs once; they are those of a laptop."""
    image = containerd.of(lab.cluster.bed).named_by_digest(images.SLIM)
    script = 'echo "$1" > "$3/out.csv"; date +%N > "$3/when"\n'
    limits = "  seed: 3\n  resources: {cpu: 0.1, memory: 256Mi}\n"
    words = ("exec", "cluster", "run", "--reuse", "-n", lab.namespace, "--image", image)
    homes = []
    for last in (4, 5):
        document = QUICK.replace("[1, 2, 3]}", f"[1, 2, 3, {last}]}}{DESIGN}")
        path = make_campaign(tmp_path / str(last), script, limits, document)
        said = lab.vast("-V", path, *words).stdout
        assert "4 of 4 done: 4 passed." in said
        homes.append(lab.download(said.partition("Campaign ")[2].split()[0]))
    second = homes[1]
    assert lab.verdicts(second) == verdicts(run_here(path, tmp_path / "here", jobs=1))
    assert "reused 3 of 4" in lab.vast("results", "summary", second).stdout
    times = [[p.read_text() for p in sorted(home.glob("*/0/when"))] for home in homes]
    assert sum(a == b for a, b in zip(*times, strict=True)) == 3


def images_of_runs(lab: Lab) -> dict[str, str]:
    """The digest of each run's image as Kubernetes reports it, by name of the pod."""
    found = {
        pod["metadata"]["name"]: container["imageID"].rpartition("://")[2]
        for pod in lab.get("pods", "--selector=robovast.io/role=shard")["items"]
        for container in pod["status"]["containerStatuses"]
        if container["name"] == "robovast"
    }
    assert all("sha256:" in image for image in found.values())
    return found


def test_failed_runs_are_told_from_broken_ones_and_repeated_alone(lab: Lab) -> None:
    """Verdicts per run of a pack; `retry` repeats bad runs and no others; more runs append.

    Somebody is told of each end, at an address that only a Secret knows.
    """
    script = 'echo run >>"$3/log"; [ "$1" != 2 ] || [ -f /tmp/never ]\n'
    told = {"kind": "ntfy", "urlFrom": {"name": "robovast-phone", "key": "url"}}
    start_receiver(lab)
    lab.quick("mixed", script, "  runs_per_job: 3\n  runs: 2\n", notifications=[told])
    lab.wait("mixed")
    status = lab.campaign("mixed")["status"]
    assert status["runs"]["passed"] == 4
    assert (status["runs"]["failed"], status["runs"]["errored"]) == (2, 0)
    assert status["failedRuns"] == "2-3"
    assert status["failing"] == ["one-2/0", "one-2/1"]
    assert lab.conditions("mixed")["Passed"]["status"] == "False"
    assert lab.conditions("mixed")["Succeeded"]["status"] == "True"
    before = lab.download("mixed")
    first = [json.loads(path.read_text()) for path in before.glob("*/*/run.json")]
    assert {record["pod"]: record["image_digest"] for record in first} == images_of_runs(lab)
    times = {path: path.stat().st_mtime for path in before.glob("*/*/run.json")}
    assert len(times) == 6
    lab.vast("exec", "cluster", "retry", "-i", "mixed", "-n", lab.namespace, code=None)
    lab.kubectl(*("wait", "campaign/mixed", "--for=jsonpath={.status.attempt}=2", "--timeout=180s"))
    lab.wait("mixed")
    after = lab.download("mixed")
    records = {
        path.parent.relative_to(after).as_posix(): json.loads(path.read_text())
        for path in after.glob("*/*/run.json")
    }
    attempts = {name: record.get("attempt", 1) for name, record in records.items()}
    assert attempts == {f"one-{v}/{r}": 2 if v == 2 else 1 for v in (1, 2, 3) for r in (0, 1)}
    lab.kubectl("patch", "campaign", "mixed", "--type=merge", '--patch={"spec":{"runs":3}}')
    lab.kubectl(
        *("wait", "campaign/mixed", "--for=jsonpath={.status.runs.total}=9", "--timeout=180s")
    )
    lab.wait("mixed")
    assert len(lab.verdicts(lab.download("mixed"))) == 9
    eventually(lambda: len(received(lab)) == 3, told="three ends are told")
    assert {(item["path"], item["title"]) for item in received(lab)} == {
        ("/topic", "mixed has failed")
    }
    assert [item["body"].splitlines()[0].partition(" after")[0] for item in received(lab)] == [
        "6 runs: 4 passed, 2 failed, 0 errored",
        "6 runs: 4 passed, 2 failed, 0 errored",
        "9 runs: 6 passed, 3 failed, 0 errored",
    ]


def test_the_log_of_a_run_is_followed_from_its_start_to_the_end_of_its_part(lab: Lab) -> None:
    """In a pack of three runs; a shell in the pod shows what the run has."""
    # On a busy node, scenario-execution may not read the last lines of a process that ends at once.
    wait = '[ "$1" != 2 ] || while ! [ -e "$3/go" ]; do sleep 0.2; done\n'
    script = f'echo "hello $1"; sleep 1; {wait}'
    lab.quick("talk", script, "  runs_per_job: 3\n  resources: {shm_size: 96Mi}\n")
    inside = ("-n", lab.namespace)
    follower = subprocess.Popen(
        [VAST, "exec", "cluster", "logs", "--follow", "talk", "one-2/0", *inside],
        env=os.environ | lab.env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert follower.stdout is not None
    assert follower.stdout.readline() == "[robovast] run one-2/0\n"
    assert "hello 1" in lab.vast("exec", "cluster", "logs", "one-1/0", *inside).stdout

    def waits() -> str:
        return lab.vast("exec", "cluster", "logs", "one-3/0", *inside).stderr

    # The kubelet tells some seconds late that its pod is prepared.
    eventually(lambda: "has not started this run yet" in waits())
    executed = lab.vast("exec", "cluster", "runs", "talk", *inside).stdout.splitlines()[1]
    assert re.match(r"one-1/0 and 2 more  running  \d+:", executed), executed
    shell = subprocess.run(
        [VAST, "exec", "cluster", "shell", "talk", "one-2/0", *inside],
        input="pwd; df --output=size -BM /dev/shm; touch one-2/0/go\n",
        env=os.environ | lab.env, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert shell.returncode == 0, shell.stderr
    assert shell.stdout.split() == ["/out", "1M-blocks", "96M"]
    assert follower.stderr is not None
    with follower:
        out, err = follower.stdout.read(), follower.stderr.read()
    assert follower.returncode == 0, err
    assert not err or "one-2/0 is pending: " in err, "unless the command began after the pod did"
    assert "hello 2" in out
    assert "hello 1" not in out
    assert "hello 3" not in out
    lab.wait("talk")
    stored = lab.vast("exec", "cluster", "logs", "one-2/0", *inside).stdout
    assert stored == "[robovast] run one-2/0\n" + out


def start_receiver(lab: Lab) -> None:
    """A pod that is told; its address goes into the Secret `robovast-phone`."""
    lab.kubectl("apply", "--filename=-", stdin=json.dumps(receiver_pod("receiver", images.AGENT)))
    lab.kubectl("wait", "pod/receiver", "--for=condition=Ready", "--timeout=180s")
    address = f"http://{lab.get('pod', 'receiver')['status']['podIP']}:{POD_PORT}/topic"
    lab.kubectl("create", "secret", "generic", "robovast-phone", f"--from-literal=url={address}")


def received(lab: Lab) -> list[dict[str, str]]:
    """What the receiver was told, each message once."""
    lines = lab.kubectl("logs", "receiver").splitlines()
    return list({item["id"]: item for item in map(json.loads, lines)}.values())


def test_a_run_is_looked_into_in_a_pod_of_its_own_and_the_results_stay_as_they_are(
    lab: Lab,
) -> None:
    lab.quick("odd", 'echo "$1 $ROBOVAST_SEED" > "$3/said.txt"; [ "$1" != 2 ]\n')
    lab.wait("odd")
    home = lab.download("odd")
    said = (home / "one-2/0/said.txt").read_text()
    bucket = lab.campaign("odd")["status"]["bucket"]
    stored = f"find /data/buckets/{bucket} -type f -exec ls -l {{}} + | sort"
    listing = ("--namespace", SYSTEM, "exec", "robovast-s3-0", "--", "sh", "-c", stored)
    before = lab.cluster.kubectl(*listing)
    told = lab.vast("exec", "cluster", "debug", "odd", "one-2/0", "-n", lab.namespace).stdout
    (pod,) = re.findall(r"delete pod (\S+)", told)
    inside = ("exec", pod, "--container=robovast", "--")
    lab.kubectl("wait", f"pod/{pod}", "--for=condition=Ready", "--timeout=180s")

    def written() -> str:
        return lab.kubectl(*inside, "sh", "-c", "cat /out/one-2/0/said.txt || true")

    assert eventually(written, told=told) == said
    (again,) = re.findall(r"again: +(.*?) +\(", told)
    lab.kubectl(*inside, "bash", "-c", f"rm /out/one-2/0/said.txt; {again} || true")
    assert written() == said
    assert lab.cluster.kubectl(*listing) == before
    lab.kubectl("delete", "pod", pod, "--timeout=180s")
    assert lab.verdicts(lab.download("odd"))["one-2/0"] == "failed"
    wrong = lab.vast("exec", "cluster", "debug", "odd", "one-9/0", "-n", lab.namespace, code=None)
    assert wrong.returncode != 0
    assert "no run `one-9/0`" in wrong.stderr


def test_a_campaign_with_a_users_plugin_is_composed_in_a_container_and_never_in_the_operator(
    lab: Lab,
) -> None:
    """The plugin says where it was executed."""
    plugin = (
        "import os\n"
        "from robovast.common.variation import Variation\n"
        "class Twice(Variation):\n"
        "    def variation(self, in_configs):\n"
        "        where = os.environ.get('HOSTNAME', '')\n"
        "        return [self.update_config(c, {'x': n, 'text': where})\n"
        "                for c in in_configs for n in (4, 5)]\n"
    )
    document = QUICK.replace(
        "  - ParameterVariationList: {name: x, values: [1, 2, 3]}\n",
        "  - plugin.py:Twice: {}\n",
    )
    folder = lab.folder / "plugin"
    path = make_campaign(folder, 'echo "$1 $2" >"$3/said"\n', "", document)
    (folder / "plugin.py").write_text(plugin)
    lab.apply(path, "plugged")
    lab.wait("plugged")
    home = lab.download("plugged")
    said = {p.parent.parent.name: p.read_text().split() for p in home.glob("*/0/said")}
    assert {name: words[0] for name, words in said.items()} == {"one-1": "4", "one-2": "5"}
    assert all("-compose-" in words[1] for words in said.values())
    lab.folder.joinpath("plugin/plugin.py").write_text(plugin.replace("update_config", "nothing"))
    lab.apply(path, "broken")
    lab.kubectl(*("wait", "campaign/broken", "--for=condition=Accepted=false", "--timeout=180s"))
    assert "nothing" in lab.conditions("broken")["Accepted"]["message"]


def job_names(lab: Lab) -> set[str]:
    return {item["metadata"]["name"] for item in lab.get("jobs")["items"]}


def test_configurations_show_entries_and_add_runs(lab: Lab) -> None:
    """One object per entry; one applied by hand adds runs; deleting it removes its Jobs."""
    lab.quick("more", "true\n")
    lab.wait("more")
    (own,) = lab.get("configurations")["items"]
    assert own["spec"]["name"] == "one"
    added = {
        "apiVersion": "robovast.io/v1beta1",
        "kind": "Configuration",
        "metadata": {"name": "extra", "namespace": lab.namespace},
        "spec": {"campaign": "more", "parameters": [{"x": 7}], "runs": 2},
    }
    lab.kubectl("apply", "--filename=-", stdin=json.dumps(added))
    lab.kubectl(
        *("wait", "campaign/more", "--for=jsonpath={.status.runs.total}=5", "--timeout=180s")
    )
    lab.wait("more")
    assert set(lab.verdicts(lab.download("more"))) == {
        "one-1/0", "one-2/0", "one-3/0", "extra/0", "extra/1",
    }  # fmt: skip
    jobs = job_names(lab)
    lab.kubectl("delete", "configuration", "extra")
    eventually(lambda: len(jobs - job_names(lab)) == 1)
    wrong = {**added, "metadata": {**added["metadata"], "name": "wrong"}}
    wrong["spec"] = {"campaign": "more", "parameters": [{"speed": 7}]}
    lab.kubectl("apply", "--filename=-", stdin=json.dumps(wrong))
    lab.kubectl(
        *("wait", "configuration/wrong", "--for=condition=Accepted=false", "--timeout=180s")
    )


def test_files_whose_mode_a_campaign_cannot_hold_travel_as_an_archive(lab: Lab) -> None:
    """A file that can be executed and does not begin with `#!`; the image's Python may be old."""
    script = 'test -x "$0" && test "$(cat /config/files/note)" = hello\n'
    path = make_campaign(lab.folder / "modes", script, document=QUICK)
    (path.parent / "files/step.sh").chmod(0o755)
    (path.parent / "files/note").write_text("hello")
    lab.vast("-V", path, "exec", "cluster", "run", "-n", lab.namespace, "--image", images.SLIM)
    (campaign,) = lab.get("campaigns")["items"]
    assert "bundle" in campaign["spec"]["source"]
    assert campaign["status"]["runs"]["passed"] == 3


def test_deleted_campaigns_leave_nothing_behind_but_what_they_were_told_to(lab: Lab) -> None:
    """Deleted in every phase; the bucket stays or goes."""
    campaigns = {}
    for retention in ("Retain", "Delete"):
        for phase in ("suspended", "running", "finished", "new"):
            script = "true\n" if phase == "finished" else "sleep 600\n"
            suspend = {"suspend": True} if phase == "suspended" else {}
            name = f"gone-{phase}-{retention.lower()}"
            lab.quick(name, script, storage={"retention": retention}, **suspend)
            campaigns[name] = (phase, retention)
            if phase == "new":
                lab.kubectl("delete", "campaign", name, "--timeout=200s")
    for name, (phase, _) in campaigns.items():
        reach(lab, name, phase)
    stored = {
        lab.campaign(name)["status"]["bucket"]: retention
        for name, (phase, retention) in campaigns.items()
        if phase == "finished"
    }
    lab.kubectl("delete", "campaigns", "--all", "--timeout=300s")
    for kind in ("jobs", "configurations", "pods"):
        lab.kubectl("wait", kind, "--all", "--for=delete", "--timeout=180s")
    eventually(lambda: "gone-" not in lab.kubectl("get", "configmaps", "-o", "name"))
    left = buckets(lab)
    assert {bucket: bucket in left for bucket in stored} == {
        bucket: retention == "Retain" for bucket, retention in stored.items()
    }


def reach(lab: Lab, name: str, phase: str) -> None:
    """Wait until a campaign is in a phase."""
    if phase == "suspended":
        state = "--for=jsonpath={.status.state}=Suspended"
        lab.kubectl("wait", f"campaign/{name}", state, "--timeout=180s")
    elif phase == "running":
        active = "--for=jsonpath={.status.runs.active}=3"
        lab.kubectl("wait", f"campaign/{name}", active, "--timeout=180s")
    elif phase == "finished":
        lab.wait(name)


def test_results_are_worked_up_in_the_cluster_when_that_is_asked_for(lab: Lab) -> None:
    """What comes home has tables, metadata and the graph; a laptop has nothing left to do."""
    folder = lab.folder / "worked"
    extra = "results_processing:\n  postprocessing:\n  - count.py:count\n"
    path = make_campaign(folder, 'echo "$1" >"$3/said"\n', extra, QUICK)
    (folder / "count.py").write_text(
        "from pathlib import Path\n"
        "def count(results_dir, config_dir):\n"
        "    found = sorted(Path(results_dir).glob('*/*/said'))\n"
        "    for path in found:\n"
        "        path.with_name('counted.csv').write_text(f'runs\\n{len(found)}\\n')\n"
        "    return True, f'{len(found)} runs'\n"
    )
    lab.apply(path, "worked", processResults=True)
    lab.wait("worked")
    home = lab.download("worked")
    assert [p.read_text() for p in sorted(home.glob("*/0/counted.csv"))] == ["runs\n3\n"] * 3
    assert {"metadata.yaml", "metadata.prov.json"} <= {p.name for p in home.iterdir()}
    asked = lab.vast("results", "sparql", "test-results", "-r", home, "-o", "json").stdout
    assert json.loads(asked)


def test_the_page_in_the_cluster_shows_what_is_in_the_storage(lab: Lab) -> None:
    """At the address that its log says, through `kubectl port-forward`; live, as it grows."""
    lab.quick("shown", f'echo "hello $1"\n{HELD}')
    eventually(lambda: lab.campaign("shown").get("status", {}).get("campaign"))
    name = lab.campaign("shown")["status"]["campaign"]
    system = ("--namespace", SYSTEM)
    said = lab.cluster.kubectl(*system, "logs", "deployment/robovast-page", "--container", "page")
    found = re.search(r"http://\S+", said)
    assert found, said
    kubectl = (programs.kubectl(), f"--kubeconfig={lab.cluster.kubeconfig}")
    forward = subprocess.Popen(
        [*kubectl, *system, "port-forward", "deployment/robovast-page", ":8400"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert forward.stdout is not None
    port = re.search(r"127\.0\.0\.1:(\d+)", forward.stdout.readline())
    assert port, "where it listens"
    page_there = re.sub(r":8400/", f":{port[1]}/", found[0]).rstrip("/")

    def asked(path: str) -> Any:
        address = f"{page_there}/api/{path}"
        try:
            with urllib.request.urlopen(address, timeout=30) as page:  # noqa: S310 - see above
                return json.load(page)
        except (OSError, ValueError):  # not yet
            return {}

    def shown() -> tuple[str, str]:
        """The campaign's state, and what jobs that go on have written."""
        answer = asked(f"campaigns/{name}")
        logs = (asked(f"log?path={job['log']}") for job in answer.get("active", ()))
        return answer.get("summary", {}).get("state", ""), "".join(map(str, logs))

    try:
        eventually(lambda: all(f"hello {x}" in shown()[1] for x in (1, 2, 3)), told=shown)
        assert shown()[0] == "running"
        release_until_finished(lab, "shown")
        eventually(lambda: shown() == ("finished", ""), told=shown)
        assert name in asked("campaigns")["campaigns"]
    finally:
        forward.terminate()
        forward.communicate()


def test_a_suspended_campaign_stops_and_goes_on(lab: Lab) -> None:
    """`spec.suspend` frees the cluster; what was stored is not executed again."""
    lab.quick("paused", "sleep 1\n", "  runs: 4\n", parallelism=2)
    lab.kubectl(
        *("wait", "campaign/paused", "--for=jsonpath={.status.state}=Running", "--timeout=180s")
    )
    lab.kubectl("patch", "campaign", "paused", "--type=merge", '--patch={"spec":{"suspend":true}}')
    lab.kubectl(
        *("wait", "campaign/paused", "--for=jsonpath={.status.state}=Suspended", "--timeout=180s")
    )
    lab.kubectl(*("wait", "job", "--all", "--for=jsonpath={.spec.suspend}=true", "--timeout=180s"))
    lab.kubectl(
        *("patch", "campaign", "paused", "--type=merge", '--patch={"spec":{"suspend":false}}')
    )
    lab.wait("paused")
    assert len(lab.verdicts(lab.download("paused"))) == 12
