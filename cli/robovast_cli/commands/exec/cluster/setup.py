"""`vast exec cluster setup`, `cleanup` and `prepare-setup`: install RoboVAST in a cluster."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Annotated, Any

import typer

from robovast.base.errors import CannotRunError, InputError, StorageError
from robovast.base.file_errors import writing
from robovast.base.plugins import load_plugin, plugins_of
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import parse_yaml
from robovast.kubeapi.cluster_config.base import BaseConfig
from robovast.kubeapi.names import CREDENTIALS_SECRET
from robovast_cli.commands.exec.cluster.chart import RELEASE, Helm, chart_folder
from robovast_cli.kube.api import KUEUE, KubernetesClient, connect
from robovast_cli.kube.api_errors import NotInstalledError
from robovast_cli.kube.options import Context, Namespace, SetupOptions, setup_config
from robovast_cli.kube.status import campaign_states
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo
from robovast_cli.ui.table import format_table

GROUP = "robovast.cluster_configs"
_DESCRIPTION = "vast exec cluster setup "
"""Start of the description of a release of `setup`, before the cluster configuration."""
ConfigOption = Annotated[
    list[str] | None,
    typer.Option(
        "-o",
        "--option",
        metavar="KEY=VALUE",
        help="Option of the cluster configuration, or value of the chart such as "
        "`operator.replicas=2` (repeatable).",
    ),
]


def _list_configs() -> None:
    """Print every cluster configuration that is installed."""
    rows = []
    for name in sorted(plugins_of(GROUP)):
        doc = (load_plugin(name, GROUP, ".").__doc__ or "").strip()
        rows.append([name, doc.partition("\n")[0]])
    echo(format_table(["CLUSTER CONFIG", "FOR"], rows).rstrip())


@examples(
    ("vast exec cluster setup --list", "List the cluster configurations"),
    ("vast exec cluster setup minikube -n lab", "Install RoboVAST in the namespace lab"),
)
def setup(
    cluster_config: Annotated[
        str | None,
        typer.Argument(metavar="CLUSTER_CONFIG", help="Cluster configuration, for example `gcp`."),
    ] = None,
    list_: Annotated[
        bool, typer.Option("--list", help="List the cluster configurations and exit.")
    ] = False,
    option: ConfigOption = None,
    force: Annotated[
        bool,
        typer.Option(
            "-f", "--force", help="Replace an installation with a different cluster configuration."
        ),
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Install or upgrade RoboVAST in the cluster (requires Helm)."""
    if list_ or cluster_config is None:
        _list_configs()
        return
    config, settings, changes = _load_config(cluster_config, option)
    with connect(context, namespace) as kube:
        helm = Helm(kube.namespace, kube.context)
        _reject_other_config(helm.installed(), cluster_config, force=force)
        config.setup_cluster(namespace=kube.namespace, kube_context=kube.context, **settings)
        echo(f"Installing RoboVAST in the namespace {kube.namespace} …")
        helm.install(_merge(_values(config, kube), changes), _DESCRIPTION + cluster_config)
        config.verify_cluster_ready(namespace=kube.namespace, kube_context=kube.context)
    echo("RoboVAST is ready. Run a campaign: vast exec cluster run")


@examples(
    ("vast exec cluster cleanup -n lab", "Delete the installation in the namespace lab"),
    ("vast exec cluster cleanup --force", "Delete it while campaigns run"),
)
def cleanup(
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Delete RoboVAST even if campaigns are running.")
    ] = False,
    _config: Annotated[str | None, setup_config("c")] = None,
    _options: SetupOptions = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Delete RoboVAST from the cluster, but keep Campaigns and CRDs.

    The results in the embedded storage are kept, unless the chart value `storage.embedded.keep`
    is false. Requires Helm.
    """
    with connect(context, namespace) as kube:
        helm = Helm(kube.namespace, kube.context)
        description = helm.installed()
        if description is None:
            raise CannotRunError(
                f"RoboVAST is not installed in the namespace {kube.namespace}.",
                hint="use `--namespace` to select another namespace",
            )
        _reject_running(kube, force=force)
        helm.uninstall()
        if description.startswith(_DESCRIPTION):
            config, _, _ = _load_config(description.removeprefix(_DESCRIPTION), None)
            config.cleanup_cluster(namespace=kube.namespace, kube_context=kube.context)
    echo(
        "RoboVAST was deleted. Campaigns and CRDs are kept. To delete them, run `kubectl delete "
        "crd campaigns.robovast.io configurations.robovast.io`."
    )


@examples(
    ("vast exec cluster prepare-setup chart --cluster-config gcp", "Write to the folder chart"),
    ("vast exec cluster prepare-setup chart --cluster-config rke2 -n lab", "Use a namespace"),
)
def prepare_setup(
    out: Annotated[Path, typer.Argument(metavar="DIR", help="New or empty folder.")],
    cluster_config: Annotated[
        str,
        typer.Option(
            "--cluster-config", metavar="NAME", help="Cluster configuration, for example `gcp`."
        ),
    ],
    option: ConfigOption = None,
    namespace: Annotated[
        str,
        typer.Option("-n", "--namespace", metavar="NAME", help="Namespace of the installation."),
    ] = "default",
) -> None:
    """Write the chart, its values and instructions for a manual setup."""
    config, settings, changes = _load_config(cluster_config, option)
    values = _external_secret(config) | _kueue(config, is_there=False, context=None)
    with writing(out):
        if out.is_dir() and any(out.iterdir()) and not (out / "values.yaml").is_file():
            raise StorageError(f"{out} contains other files", hint="choose a new or empty folder")
        out.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(out / RELEASE, ignore_errors=True)
        shutil.copytree(chart_folder(), out / RELEASE)
        (out / "values.yaml").write_text(dump_yaml(_merge(values, changes)), encoding="utf-8")
        config.prepare_setup_cluster(str(out), namespace=namespace, **settings)
        (out / "README.md").write_text(_readme(cluster_config, config, namespace), encoding="utf-8")
    echo(f"Next: follow {out / 'README.md'}.")


def _load_config(
    name: str, options: Sequence[str] | None
) -> tuple[BaseConfig, dict[str, str], list[tuple[str, str]]]:
    """Return the cluster configuration, its options, and changed values of the chart."""
    pairs = [_pair(option) for option in options or ()]
    settings = {key: value for key, value in pairs if "." not in key}
    config: BaseConfig = load_plugin(name, GROUP, ".")()
    config.restore_from_setup_kwargs(settings)
    return config, settings, [(key, value) for key, value in pairs if "." in key]


def _pair(option: str) -> tuple[str, str]:
    key, separator, value = option.partition("=")
    if not separator or not key:
        raise InputError(
            f"`--option {option}` is not of the form KEY=VALUE.",
            hint="use for example `--option operator.replicas=2`",
        )
    return key, value


def _merge(values: dict[str, Any], changes: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """Return values of a chart with changes such as `("operator.replicas", "2")`."""
    changed = deepcopy(values)
    for key, value in changes:
        *path, last = key.split(".")
        section = changed
        for name in path:
            section = section.setdefault(name, {})
        section[last] = parse_yaml(value)
    return changed


def _reject_other_config(description: str | None, name: str, *, force: bool) -> None:
    """Raise an error if the storage would change, because its results would not be accessible."""
    before = (description or "").removeprefix(_DESCRIPTION)
    if description and description.startswith(_DESCRIPTION) and before != name and not force:
        raise CannotRunError(
            f"RoboVAST is installed in this cluster with the cluster configuration `{before}`",
            hint=f"use `--force` to install `{name}` instead; results in the current storage are "
            "then not accessible",
        )


def _reject_running(kube: KubernetesClient, *, force: bool) -> None:
    try:
        campaigns = campaign_states(kube)
    except NotInstalledError:
        return
    running = [campaign.name for campaign in campaigns if not campaign.finished]
    if running and not force:
        raise CannotRunError(
            f"campaigns are not finished: {', '.join(running)}",
            hint="wait for them, or use `--force`. They continue when RoboVAST is installed again",
        )


def _values(config: BaseConfig, kube: KubernetesClient) -> dict[str, Any]:
    """Return the values of the chart, with credentials."""
    values: dict[str, Any] = config.chart_values()
    access, secret = config.get_s3_credentials()
    storage = values.setdefault("storage", {})
    if access and secret and "credentials" not in storage:
        storage["credentials"] = {"accessKey": access, "secretKey": secret}
    if not config.uses_embedded_s3() and "credentials" not in storage:
        raise InputError(
            f"the S3 server {config.get_s3_endpoint()} needs credentials",
            hint="set $ROBOVAST_S3_ACCESS_KEY and $ROBOVAST_S3_SECRET_KEY, or name a Secret "
            "with `-o s3_secret=NAME`",
        )
    return values | _kueue(
        config, is_there=kube.version_of(KUEUE) is not None, context=kube.context
    )


def _external_secret(config: BaseConfig) -> dict[str, Any]:
    """Return the values of the chart, with the name of a Secret instead of credentials."""
    values = config.chart_values()
    if not config.uses_embedded_s3():
        values["storage"].setdefault("credentials", {"existingSecret": CREDENTIALS_SECRET})
    return values


def _kueue(config: BaseConfig, *, is_there: bool, context: str | None) -> dict[str, Any]:
    wanted = config.options.get("kueue", "auto")
    if wanted not in {"auto", "true", "false"}:
        raise InputError(
            f"kueue: `{wanted}` is not a valid value", hint="use one of auto, true, false"
        )
    if wanted == "false" or (wanted == "auto" and not is_there):
        return {"kueue": {"enabled": False}}
    cores, memory = config.get_cluster_allocatable_resources(context)
    resources = {"cpu": str(cores), "memory": f"{memory // 2**20}Mi"}
    return {"kueue": {"enabled": True, "resources": resources}}


_README = """\
# RoboVAST on a cluster ({name})

`values.yaml` contains the values of the chart in `robovast/` for this cluster.

{notes}{secret}
```bash
helm upgrade robovast ./robovast --install --namespace {namespace} --create-namespace \\
  --values values.yaml --wait
vast exec cluster run
```

Remove RoboVAST:

```bash
helm uninstall robovast --namespace {namespace}
```
"""

_CREDENTIALS = """
The credentials of the S3 server are not in this folder. Write each key to a separate file, and
create the Secret that the chart expects:

```bash
kubectl create secret generic {secret} --namespace {namespace} \\
  --from-file=accessKey --from-file=secretKey
```
"""


def _readme(name: str, config: BaseConfig, namespace: str) -> str:
    secret = config.options.get("s3_secret") or CREDENTIALS_SECRET
    needed = not config.uses_embedded_s3()
    text = _CREDENTIALS.format(secret=secret, namespace=namespace) if needed else ""
    return _README.format(name=name, notes=config.NOTES, namespace=namespace, secret=text)
