"""`vast exec`: run campaigns on this machine or on a cluster."""

from robovast_cli.lazy import Lazy, new_group

LOCAL = {
    "run": Lazy("local", "Run a campaign on this machine."),
    "prepare-run": Lazy(
        "local", "Write a folder with a `run.sh` that runs Docker Compose by hand."
    ),
}
CLUSTER = {
    "run": Lazy("run", "Run a campaign on the cluster and wait until it completes."),
    "monitor": Lazy("monitor", "Watch running campaigns."),
    "logs": Lazy("logs", "Print the log of a running or stored run."),
    "runs": Lazy("runs", "List the running and the unsuccessful runs of a campaign."),
    "shell": Lazy("shell", "Open a shell in the container of a running run (requires kubectl)."),
    "debug": Lazy("debug", "Run a run again in a separate pod, and keep the pod for inspection."),
    "setup": Lazy("setup", "Install or upgrade RoboVAST in the cluster (requires Helm)."),
    "cleanup": Lazy("setup", "Delete RoboVAST from the cluster, but keep Campaigns and CRDs."),
    "prepare-setup": Lazy(
        "setup", "Write the chart, its values and instructions for a manual setup."
    ),
    "prepare-run": Lazy(
        "prepare_run", "Write the Campaign and instructions to run it with kubectl."
    ),
    "stop": Lazy("control", "Stop a campaign and keep its stored runs."),
    "resume": Lazy("control", "Resume a stopped campaign after its last stored run."),
    "retry": Lazy("control", "Run the failed and errored runs of a finished campaign again."),
    "run-cleanup": Lazy(
        "deletion", "Delete finished Campaigns from the cluster, but keep their results."
    ),
    "download-cleanup": Lazy(
        "deletion", "Delete the results of finished campaigns from the object storage."
    ),
    "upload-to-share": Lazy(
        "upload_to_share", "Upload results of finished campaigns to the remote file share."
    ),
}
GROUPS = {
    "local": Lazy("app:local", "Run campaigns on this machine."),
    "cluster": Lazy("app:cluster", "Run campaigns on a Kubernetes cluster."),
}

local = new_group(
    "Run campaigns on this machine.\n\nRuns use Docker, Podman or local processes (no container).",
    "robovast_cli.commands.exec",
    LOCAL,
)
cluster = new_group(
    "Run campaigns on a Kubernetes cluster.", "robovast_cli.commands.exec.cluster", CLUSTER
)
app = new_group("Run campaigns.", "robovast_cli.commands.exec", GROUPS)
