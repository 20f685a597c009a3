"""The objects that are made for a campaign."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from typing import Any

import pytest
from support.kube.fake_cluster import SCENARIO, SETTINGS, accepted, campaign

from robovast.agent.scripts import AWAIT, SHELL
from robovast.base.docstrings import WITHOUT
from robovast.kubeapi.notice import Named, Notice, Order
from robovast.kubeapi.pod_contract.mounts import Mount
from robovast.kubeapi.pod_contract.pack_request import PackRequest
from robovast.kubeapi.resources import Notification, Scheduling
from robovast.kubeapi.source_files import inline_files
from robovast.model.packs import CampaignPlan, Owner
from robovast_operator.kube.store import JobState
from robovast_operator.planning.accept import accept, same_document, source_changed
from robovast_operator.planning.campaign import Accepted, Rejected
from robovast_operator.planning.configurations import own_configurations
from robovast_operator.planning.revisions import next_revision
from robovast_operator.planning.shards import evenly, first_attempts
from robovast_operator.pods.jobs import (
    campaign_plan,
    files_config_map,
    plan_config_map,
    shard_job,
    task_job,
)
from robovast_operator.pods.templates import inline_items, notify_pod, run_pod
from robovast_operator.settings import OperatorSettings

START = "/.robovast/start.sh"
FILES = {"scenario.osc": SCENARIO.encode()}


def job_of(made: Accepted, settings: OperatorSettings = SETTINGS) -> dict[str, Any]:
    revision = next_revision(made, (), (), made.identity.child("plan-0"))
    assert revision is not None
    (shard,) = first_attempts(made.identity, [revision])
    return shard_job(made, settings, shard)


def containers(job: dict[str, Any]) -> dict[str, dict[str, Any]]:
    pod = job["spec"]["template"]["spec"]
    return {c["name"]: c for c in [*pod["initContainers"], *pod["containers"]]}


def rejected(change: Any, files: dict[str, bytes] | None = None) -> Rejected:
    obj = campaign()
    change(obj)
    found = accept(obj, FILES if files is None else files, SETTINGS)
    assert isinstance(found, Rejected), found
    return found


def test_what_decides_about_runs_stays_while_their_most_may_be_raised() -> None:
    def needed(most: int, good: float = 0.05) -> dict[str, Any]:
        rule = {"min": 3, "max": most, "decide": {"good": good, "bad": 0.2}}
        vast: dict[str, Any] = campaign()["spec"]["vast"]
        return {**vast, "execution": {**vast["execution"], "runs": rule}}

    text = json.dumps(needed(50))
    assert same_document(text, needed(80))
    assert not same_document(text, needed(50, good=0.1))
    assert not same_document(text, campaign()["spec"]["vast"])
    job = job_of(accepted(as_needed=needed(50)["execution"]["runs"]))
    assert job["spec"]["completions"] == 3


def test_what_can_never_decide_about_runs_is_refused() -> None:
    def change(obj: Any) -> None:
        obj["spec"]["vast"]["execution"]["runs"] = {"decide": {"good": 0.3, "bad": 0.2}}

    assert "`good` must be less than `bad`" in rejected(change).message


def test_only_our_own_containers_see_credentials_and_nobody_a_token() -> None:
    job = job_of(accepted())
    pod = job["spec"]["template"]["spec"]
    assert pod["automountServiceAccountToken"] is False
    for name, container in containers(job).items():
        mounts = {mount["name"] for mount in container.get("volumeMounts", ())}
        assert ("credentials" in mounts) == (name == "agent"), name
    text = json.dumps(job)
    assert "secretKeyRef" not in text
    assert "hostPath" not in text


def test_our_containers_read_no_docstrings_but_those_that_explain_documents() -> None:
    made = accepted()
    found = [*containers(job_of(made)).values()]
    for task in ("compose", "propose", "finish"):
        found += task_job(made, SETTINGS, task, task, "plan")["spec"]["template"]["spec"][
            "containers"
        ]
    without = {c["name"] for c in found if any(v["name"] == WITHOUT for v in c.get("env", ()))}
    assert without == {"agent", "finish"}


def test_a_run_container_sees_its_inputs_and_its_output_and_may_not_change_the_former() -> None:
    run = containers(job_of(accepted()))["robovast"]
    assert [(m["mountPath"], m.get("readOnly", False)) for m in run["volumeMounts"]] == [
        ("/config", True),
        ("/out", False),
    ]


def test_containers_start_in_the_order_of_the_contract() -> None:
    obj = campaign()
    obj["spec"]["vast"]["execution"]["secondary_containers"] = ["sim"]
    made = accept(obj, FILES, SETTINGS)
    assert isinstance(made, Accepted)
    job = job_of(made)
    pod = job["spec"]["template"]["spec"]
    assert [c["name"] for c in pod["initContainers"]] == ["compat-version", "sim"]
    assert [c["name"] for c in pod["containers"]] == ["agent", "robovast"]
    assert containers(job)["sim"]["restartPolicy"] == "Always"


def test_containers_of_a_run_wait_until_its_agent_has_prepared_it() -> None:
    obj = campaign()
    obj["spec"]["vast"]["execution"]["secondary_containers"] = ["sim"]
    made = accept(obj, FILES, SETTINGS)
    assert isinstance(made, Accepted)
    found = containers(job_of(made))
    waiting = [*SHELL, "-c", AWAIT.read_text(), f"/config{START}"]
    assert found["robovast"]["command"] == waiting
    assert found["sim"]["command"] == [*waiting, "sim"]
    agent = found["agent"]
    assert agent["command"][3:8] == ["agent", "--first-pack", "0", "--attempt", "1"]
    probe = agent["startupProbe"]
    assert probe["exec"]["command"] == ["test", "-e", f"{Mount.WORK.path}/config{START}"]
    assert probe["periodSeconds"] * probe["failureThreshold"] >= 24 * 3600, "inputs may be large"
    quiet = containers(job_of(made, replace(SETTINGS, silence_minutes=0)))["agent"]
    assert ("startupProbe" in quiet, "readinessProbe" in quiet) == (True, False)


def test_people_who_name_no_container_mean_the_run() -> None:
    template = job_of(accepted())["spec"]["template"]["metadata"]
    assert template["annotations"]["kubectl.kubernetes.io/default-container"] == "robovast"


def test_exit_codes_decide_what_is_tried_again() -> None:
    rules = job_of(accepted())["spec"]["podFailurePolicy"]["rules"]
    told = {
        (rule["action"], rule["onExitCodes"]["containerName"]): rule["onExitCodes"]["values"]
        for rule in rules
        if "onExitCodes" in rule
    }
    assert told == {
        ("FailJob", "compat-version"): [78],
        ("FailJob", "agent"): [64, 65, 73, 76],
        ("FailIndex", "agent"): [10, 11, 77],
        ("Ignore", "agent"): [74],
        ("Count", "agent"): [0],
    }


def test_a_queue_gets_suspended_jobs_with_its_labels() -> None:
    job = job_of(accepted(queueName="robovast", queuePriorityClassName="urgent"))
    assert job["spec"]["suspend"] is True
    assert job["metadata"]["labels"]["kueue.x-k8s.io/queue-name"] == "robovast"
    assert job["metadata"]["labels"]["kueue.x-k8s.io/priority-class"] == "urgent"
    assert JobState.of({**job, "metadata": {**job["metadata"], "uid": "1"}}).priority == "urgent"
    assert job_of(accepted())["spec"]["suspend"] is False


def test_scheduling_reaches_the_pod_and_nothing_else_does() -> None:
    scheduling = {
        "nodeSelector": {"disk": "fast"},
        "tolerations": [{"key": "gpu", "operator": "Exists"}],
        "priorityClassName": "low",
        "imagePullSecrets": [{"name": "robovast-registry"}],
    }
    obj = campaign(scheduling=scheduling)
    labels = {"jobs": {"node_labels": {"zone": "a"}}}
    obj["spec"]["vast"]["execution"]["kubernetes"] = labels
    made = accept(obj, FILES, SETTINGS)
    assert isinstance(made, Accepted)
    pod = job_of(made)["spec"]["template"]["spec"]
    linux = {"kubernetes.io/os": "linux"}
    assert pod["nodeSelector"] == linux | {"disk": "fast", "zone": "a"}
    assert pod["tolerations"] == [{"key": "gpu", "operator": "Exists"}]
    assert pod["priorityClassName"] == "low"
    assert pod["imagePullSecrets"] == [{"name": "robovast-registry"}]
    wrong = rejected(lambda o: o["spec"].update(scheduling={"hostNetwork": True}))
    assert "spec.scheduling.hostNetwork" in wrong.message


def test_pods_run_on_linux_nodes_of_the_architectures_of_our_image() -> None:
    settings = replace(SETTINGS, architectures=("amd64", "arm64"))
    arm = {"key": "kubernetes.io/arch", "operator": "NotIn", "values": ["arm"]}
    made = accepted(scheduling={"nodeAffinity": {"required": [arm]}})
    task = task_job(made, settings, "finish", "finish-0", "plan")
    for job in (job_of(made, settings), task):
        pod = job["spec"]["template"]["spec"]
        assert pod["nodeSelector"] == {"kubernetes.io/os": "linux"}
        affinity = pod["affinity"]["nodeAffinity"]
        required = affinity["requiredDuringSchedulingIgnoredDuringExecution"]
        (term,) = required["nodeSelectorTerms"]
        ours = {"key": "kubernetes.io/arch", "operator": "In", "values": ["amd64", "arm64"]}
        assert term["matchExpressions"] == [arm, ours]


def test_pods_are_on_the_nodes_that_a_campaign_requires_and_spread_over_them() -> None:
    zone, fast = {"key": "zone", "values": ["a", "b"]}, {"key": "fast", "operator": "Exists"}
    affinity = {"required": [zone], "preferred": [fast | {"weight": 5}]}
    spreads = [{"topologyKey": "kubernetes.io/hostname", "maxSkew": 2}]
    made = accepted(scheduling={"nodeAffinity": affinity, "topologySpread": spreads})
    pod = job_of(made)["spec"]["template"]["spec"]
    assert pod["affinity"]["nodeAffinity"] == {
        "requiredDuringSchedulingIgnoredDuringExecution": {
            "nodeSelectorTerms": [{"matchExpressions": [zone | {"operator": "In"}]}]
        },
        "preferredDuringSchedulingIgnoredDuringExecution": [
            {"weight": 5, "preference": {"matchExpressions": [fast]}}
        ],
    }
    (spread,) = pod["topologySpreadConstraints"]
    labels = job_of(made)["spec"]["template"]["metadata"]["labels"]
    assert spread.pop("labelSelector")["matchLabels"].items() <= labels.items()
    assert spread == {**spreads[0], "whenUnsatisfiable": "ScheduleAnyway"}
    task = task_job(made, SETTINGS, "finish", "finish", "plan")["spec"]["template"]["spec"]
    assert "affinity" in task
    assert "topologySpreadConstraints" not in task
    plain = job_of(accepted())["spec"]["template"]["spec"]
    assert not {"affinity", "topologySpreadConstraints"} & set(plain)
    none = {"nodeAffinity": {"required": [{"key": "zone"}]}}
    assert "need at least one" in rejected(lambda o: o["spec"].update(scheduling=none)).message


def test_resources_are_those_of_the_cluster() -> None:
    obj = campaign(cluster="gcp")
    obj["spec"]["vast"]["execution"]["resources"] = {
        "cpu": [{"gcp": 4}, {"local": 8}],
        "memory": "2Gi",
    }
    made = accept(obj, FILES, SETTINGS)
    assert isinstance(made, Accepted)
    limits = containers(job_of(made))["robovast"]["resources"]["limits"]
    assert limits == {"cpu": "4000m", "memory": str(2 * 2**30)}
    obj["spec"]["cluster"] = "azure"
    refused = accept(obj, FILES, SETTINGS)
    assert isinstance(refused, Rejected)
    assert "azure" in refused.message


def asking(execution: dict[str, Any], cluster: str = "gcp") -> dict[str, Any]:
    obj = campaign(cluster=cluster)
    obj["spec"]["vast"]["execution"] |= execution
    return obj


def test_containers_of_a_run_share_as_much_memory_as_the_document_says() -> None:
    obj = asking({"secondary_containers": ["sim"], "resources": {"shm_size": [{"gcp": "1Gi"}]}})
    made = accept(obj, FILES, SETTINGS)
    assert isinstance(made, Accepted)
    job = job_of(made)
    volume = {"name": "shm", "emptyDir": {"medium": "Memory", "sizeLimit": str(2**30)}}
    assert volume in job["spec"]["template"]["spec"]["volumes"]
    mounted = {
        name
        for name, container in containers(job).items()
        if {"name": "shm", "mountPath": "/dev/shm"} in container.get("volumeMounts", ())
    }
    assert mounted == {"robovast", "sim"}
    assert "/dev/shm" not in json.dumps(job_of(accepted()))


def test_gpus_are_counted_by_the_name_that_the_cluster_has_for_them() -> None:
    names = {"gpu_resource": [{"gcp": "nvidia.com/mig-1g.5gb"}, {"rke2": "amd.com/gpu"}]}
    execution = {"resources": {"gpu": 2}, "kubernetes": names}
    for cluster, name in (("gcp", "nvidia.com/mig-1g.5gb"), ("rke2", "amd.com/gpu")):
        made = accept(asking(execution, cluster), FILES, SETTINGS)
        assert isinstance(made, Accepted)
        assert containers(job_of(made))["robovast"]["resources"]["limits"] == {name: "2"}
    assert isinstance(accept(asking(execution, "azure"), FILES, SETTINGS), Rejected)


def test_a_document_says_how_much_disk_a_pod_needs_within_what_is_allowed() -> None:
    obj = asking({"kubernetes": {"ephemeral_storage": "6Gi"}})
    made = accept(obj, FILES, replace(SETTINGS, work_request="1Gi", work_limit="8Gi"))
    assert isinstance(made, Accepted)
    job = job_of(made)
    amount = str(6 * 2**30)
    work = {"name": "work", "emptyDir": {"sizeLimit": amount}}
    assert work in job["spec"]["template"]["spec"]["volumes"]
    assert containers(job)["agent"]["resources"]["requests"]["ephemeral-storage"] == amount
    refused = accept(obj, FILES, replace(SETTINGS, work_limit="5Gi"))
    assert isinstance(refused, Rejected)
    assert "no more than 5Gi, the limit of this installation. Ask your" in refused.message
    assert "`agent.diskLimit`" in refused.message


@pytest.mark.parametrize(
    ("execution", "message"),
    [
        ({"resources": {"shm_size": "2Gi", "memory": "1Gi"}}, "no more than `memory`"),
        ({"resources": {"shm_size": 0}}, "more than nothing"),
        ({"resources": {"memory": 4}}, "Write for example `4Gi`."),
        ({"kubernetes": {"ephemeral_storage": 20}}, "Write for example `20Gi`."),
        ({"kubernetes": {"gpu_resource": [{"gcp": "memory"}]}}, "not a valid name of a resource"),
        ({"kubernetes": {"ephemeral_storage": "much"}}, "not a valid quantity"),
    ],
)
def test_what_no_pod_can_have_is_refused(execution: dict[str, Any], message: str) -> None:
    refused = accept(asking(execution), FILES, SETTINGS)
    assert isinstance(refused, Rejected)
    assert message in refused.message


def test_the_plan_says_what_pods_need_and_is_fixed() -> None:
    made = accepted(runs=4, select=["hall-1*"])
    revision = next_revision(made, (), (), "plan-0")
    assert revision is not None
    obj = plan_config_map(made, "plan-0", campaign_plan(made, revision.plan, revision.entries))
    assert obj["immutable"] is True
    plan = CampaignPlan.model_validate_json(obj["data"]["campaign.json"])
    assert plan.plan is not None
    assert (plan.plan.total, plan.campaign, plan.runs) == (4, "drive-2026-11-21-070000", 4)
    assert plan.bucket == "drive-2026-11-21-070000-01234567"
    assert plan.owner == Owner(
        uid="0123-4567", namespace="lab", name="drive", campaign="drive-2026-11-21-070000"
    )


def test_the_plan_fixes_inputs_and_what_they_expand_to() -> None:
    made = accepted()
    plan = campaign_plan(made, None, made.entries)
    assert plan.inputs == {"scenario.osc": hashlib.sha256(SCENARIO.encode()).hexdigest()}
    (entry,) = plan.entries
    (other,) = accepted(select=["hall-1", "hall-2", "hall-3"]).entries
    (fewer,) = accepted(select=["hall-1"]).entries
    assert entry.digest == other.digest != fewer.digest


def test_a_campaign_keeps_its_seed_whatever_becomes_of_the_operator() -> None:
    made = accepted()
    drawn = campaign_plan(made, None, ()).seed
    assert drawn == campaign_plan(accepted(), None, ()).seed is not None
    other = replace(made, identity=replace(made.identity, uid="another"))
    assert campaign_plan(other, None, ()).seed not in {None, drawn}
    execution = made.vast.execution.model_copy(update={"seed": 0})
    given = replace(made, vast=made.vast.model_copy(update={"execution": execution}))
    planned = campaign_plan(given, None, ())
    assert planned.seed == 0
    assert campaign_plan(replace(made, planned=planned), None, ()).seed == 0


def test_inline_files_are_mounted_as_the_tree_that_they_are() -> None:
    files = {"scenario.osc": SCENARIO, "files/deep/a.py": "1"}
    binary = {"map.pgm": "UDUK"}
    obj = campaign(source={"inline": {"files": files, "binaryFiles": binary}})
    made = accept(obj, inline_files(obj["spec"]), SETTINGS)
    assert isinstance(made, Accepted)
    config_map = files_config_map(made, None)
    assert config_map is not None
    keys = {item["path"]: item["key"] for item in inline_items(made)}
    assert keys.keys() == {"scenario.osc", "files/deep/a.py", "map.pgm"}
    assert config_map["data"][keys["files/deep/a.py"]] == "1"
    assert config_map["binaryData"][keys["map.pgm"]] == "UDUK"


def test_every_entry_has_a_configuration() -> None:
    obj = campaign()
    obj["spec"]["vast"]["configuration"].append({"name": "Main_Hall"})
    made = accept(obj, FILES, SETTINGS)
    assert isinstance(made, Accepted)
    names = [item["metadata"]["name"] for item in own_configurations(made)]
    assert names[0] == "drive-hall"
    assert names[1].startswith("drive-main-hall-")
    assert [item["spec"]["name"] for item in own_configurations(made)] == ["hall", "Main_Hall"]


EVIL = {"evil.py:Evil": {}}


@pytest.mark.parametrize(
    "call",
    [
        EVIL,
        {"OneOfVariation": {"variations": [EVIL]}},
        {"OneOfVariation": {"variations": [{"OneOfVariation": {"variations": ["evil.py:Evil"]}}]}},
        {"OneOfVariation": {"variations": [{"unknown": {}}, EVIL]}},
    ],
)
def test_a_plugin_is_never_executed_here(call: dict[str, Any]) -> None:
    obj = campaign()
    entry = obj["spec"]["vast"]["configuration"][0]
    entry["variations"] = [call]
    files = {**FILES, "evil.py": b"raise SystemExit('executed')"}
    made = accept(obj, files, SETTINGS)
    assert isinstance(made, Accepted)
    assert (made.pure, made.entries) == (False, ())


def test_the_disk_of_a_runs_pod_is_limited() -> None:
    settings = replace(SETTINGS, work_limit="20Gi")
    revision = next_revision(accepted(), (), (), "plan-0")
    assert revision is not None
    (shard, *_) = first_attempts(accepted().identity, [revision])
    pod = shard_job(accepted(), settings, shard)["spec"]["template"]["spec"]
    limited = {"name": "work", "emptyDir": {"sizeLimit": "20Gi"}}
    assert limited in pod["volumes"]
    made = accepted()
    tasks = {c: task_job(made, settings, c, c, "plan") for c in ("compose", "finish", "process")}
    volumes = {c: job["spec"]["template"]["spec"]["volumes"] for c, job in tasks.items()}
    assert [limited in found for found in volumes.values()] == [True, True, False]


def test_a_runs_pod_asks_for_room_on_the_disk_when_that_is_set() -> None:
    """By one container, and no limit of any: that would count what runs write to the volume."""
    (plain, asking) = (
        run_pod(accepted(), replace(SETTINGS, work_request=request), "plan-0", PackRequest(0))
        for request in ("", "5Gi")
    )

    def amounts(pod: dict[str, Any], kind: str) -> list[str]:
        found = [c["resources"].get(kind, {}) for c in (*pod["initContainers"], *pod["containers"])]
        return [one["ephemeral-storage"] for one in found if "ephemeral-storage" in one]

    assert [amounts(pod, "requests") for pod in (plain, asking)] == [[], ["5Gi"]]
    assert [amounts(pod, "limits") for pod in (plain, asking)] == [[], []]


def test_an_account_on_a_git_server_is_mounted_where_the_checkout_is_made() -> None:
    git = {"url": "https://git.example.org/a", "ref": "main", "secretName": "robovast-git"}
    obj = campaign(source={"git": git})
    made = accept(obj, None, SETTINGS)
    assert isinstance(made, Accepted)
    composing, finishing = (task_job(made, SETTINGS, c, c, "plan") for c in ("compose", "finish"))
    assert "robovast-git" in json.dumps(composing["spec"])
    assert "robovast-git" not in json.dumps(finishing["spec"])
    assert "robovast-git" not in json.dumps(job_of(replace(made, entries=accepted().entries)))


def test_tasks_run_our_own_image_alone() -> None:
    job = task_job(accepted(), SETTINGS, "compose", "drive-0123-compose", "plan")
    (container,) = job["spec"]["template"]["spec"]["containers"]
    assert container["image"] == SETTINGS.agent_image


def test_what_cannot_be_composed_is_given_up_within_minutes_and_results_for_hours() -> None:
    made = (task_job(accepted(), SETTINGS, c, c, "plan") for c in ("compose", "finish"))
    assert [job["spec"]["backoffLimit"] for job in made] == [5, 20]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda o: o["spec"]["vast"]["execution"].pop("image"), "execution.image"),
        (lambda o: o["spec"]["vast"].update(version=3), "version"),
        (lambda o: o["spec"]["vast"]["execution"].update(runz=1), "runz"),
        (lambda o: o["spec"].update(select=["nothing-*"]), "nothing-*"),
        (lambda o: o["spec"].update(colour="red"), "spec.colour"),
    ],
)
def test_what_is_wrong_is_said_by_its_place(change: Any, said: str) -> None:
    assert said in rejected(change).message


def test_a_message_names_the_document_not_a_temporary_folder() -> None:
    wrong = rejected(lambda o: o["spec"]["vast"]["execution"].update(scenario_file="gone.osc"))
    assert wrong.message.startswith("The .vast file is invalid:\ndrive.vast:")
    assert "/tmp" not in wrong.message


@pytest.mark.parametrize("path", ["../up", "/etc/passwd", "a/../../b", ""])
def test_files_stay_in_their_folder(path: str) -> None:
    with pytest.raises(ValueError, match=r"folder|String should have"):
        inline_files({"vast": {}, "source": {"inline": {"files": {path: "x"}}}})


def test_a_document_may_change_in_its_number_of_runs_alone() -> None:
    text = accepted().document_text
    vast = campaign()["spec"]["vast"]
    assert same_document(text, vast)
    more = {**vast, "execution": {**vast["execution"], "runs": 9}}
    assert same_document(text, more)
    other = {**vast, "execution": {**vast["execution"], "timeout": 9}}
    assert not same_document(text, other)


def test_the_users_own_text_is_kept_when_it_says_the_same() -> None:
    obj = campaign()
    text = "# mine\n" + json.dumps(obj["spec"]["vast"])
    made = accept(obj, {**FILES, "drive.vast": text.encode()}, SETTINGS)
    assert isinstance(made, Accepted)
    assert made.document_text == text
    other = accept(obj, {**FILES, "drive.vast": b"version: 1"}, SETTINGS)
    assert isinstance(other, Accepted)
    assert "hall" in other.document_text


@pytest.mark.parametrize("packs", [1, 500, 501, 10_000, 1_000_000])
def test_packs_are_spread_evenly_over_a_bounded_number_of_shards(packs: int) -> None:
    cut = evenly(packs)
    assert sum(size for _, size in cut) == packs
    assert [begin for begin, _ in cut] == [sum(s for _, s in cut[:i]) for i in range(len(cut))]
    assert max(size for _, size in cut) - min(size for _, size in cut) <= 1
    assert len(cut) <= 400


def test_a_config_map_is_copied_as_far_as_it_is_wanted() -> None:
    """Pods mount the copy, which nobody changes, under the paths that the Campaign says."""
    items = [{"key": "scenario", "path": "scenario.osc"}]
    obj = campaign(source={"configMap": {"name": "theirs", "items": items}})
    made = accept(obj, {"scenario.osc": SCENARIO.encode()}, SETTINGS)
    assert isinstance(made, Accepted)
    theirs = {"data": {"scenario": SCENARIO, "other": "x"}, "binaryData": {"more": "AAAA"}}
    copy = files_config_map(made, theirs)
    assert copy is not None
    assert (copy["data"], copy["binaryData"]) == ({"scenario": SCENARIO}, {})
    assert (copy["immutable"], copy["metadata"]["name"]) == (True, made.identity.files)
    mounted = run_pod(made, SETTINGS, "plan-0", PackRequest(0))["volumes"]
    (source,) = next(v["projected"]["sources"] for v in mounted if v["name"] == "files")
    assert source["configMap"] == {"name": made.identity.files, "items": items}


def test_a_campaign_whose_files_are_others_than_planned_is_told_so() -> None:
    made = accepted()
    planned = campaign_plan(replace(made, inputs={"a.osc": "1" * 64}), None, ())
    assert source_changed(None, made) is None
    assert source_changed(planned, replace(made, inputs={"a.osc": "1" * 64, "b": "2"})) is None
    for now in ({"a.osc": "3" * 64}, {}):
        told = source_changed(planned, replace(made, inputs=now))
        assert told is not None
        assert (told.reason, "`a.osc`" in told.message) == ("SourceChanged", True)


def test_a_notice_and_its_address_arrive_with_every_dollar() -> None:
    about = Named(namespace="lab", name="drive", uid="1")
    notice = Notice(
        id="1",
        event="Stalled",
        time="2026-11-21T07:00:00Z",
        campaign=about,
        message="write `$$x` for a text `$x`; $(HOME) is no value",
    )
    url = "https://hooks.example/a?key=p$$q$(HOME)"
    receiver = Notification.model_validate({"kind": "webhook", "url": url})
    order = Order(notice=notice, receivers=[receiver])
    (container,) = notify_pod(SETTINGS, Scheduling(), order)["containers"]
    seen: dict[str, str] = {}
    for variable in container["env"]:
        if "value" in variable:
            seen[variable["name"]] = expanded(variable["value"], seen)
    assert Order.model_validate_json(seen["ROBOVAST_NOTICE"]) == order


def expanded(text: str, known: dict[str, str]) -> str:
    """What the kubelet makes of a variable's value."""
    parts = re.compile(r"\$\$|\$\(([^)]*)\)")
    return parts.sub(lambda part: "$" if part[0] == "$$" else known.get(part[1], part[0]), text)
