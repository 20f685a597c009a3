"""The shared state of all jobs of a local campaign execution."""

from __future__ import annotations

import hashlib
import os
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from robovast.campaign.imported import is_imported
from robovast.campaign.layout import Layout
from robovast.execution.job_config import job_environment
from robovast.execution.local.events import LocalOptions
from robovast.execution.local.limits import main_limits, secondary_limits
from robovast.execution.local.runtime import Limits, Runtime, RuntimeIdentity, StartSpec
from robovast.execution.run_key import common_key, run_keys
from robovast.model.document import Document
from robovast.model.document.section import merge_pairs
from robovast.model.expansion import Variant
from robovast.model.plan import PackStart, Run
from robovast.model.quantities import machine_cpus, machine_memory
from robovast.model.scenario import Scenario, read_scenario

DEFAULT_USER = 1000
COMMON = "common"
"""Folder of a campaign's private copy of the shared inputs, below `.running`."""

_ANY_JOB = PackStart(0, (Run(0, Variant("", "", {}), 0),))


@dataclass(frozen=True)
class Session:
    """One execution of a campaign on this machine."""

    document: Document
    layout: Layout
    options: LocalOptions
    runtime: Runtime
    identity: RuntimeIdentity

    @cached_property
    def token(self) -> str:
        """Name of the campaign on this machine, equal for all its executions."""
        return "robovast-" + hashlib.sha256(str(self.layout.root).encode()).hexdigest()[:12]

    @cached_property
    def host(self) -> str:
        """This machine's name."""
        return socket.gethostname()

    @cached_property
    def scenario(self) -> Scenario:
        """The document's scenario."""
        return read_scenario(self.document.scenario)

    @cached_property
    def limits(self) -> Limits:
        """Limits of the main container."""
        return main_limits(self.document.vast.execution)

    @cached_property
    def secondaries(self) -> dict[str, Limits]:
        """Limits of each secondary container."""
        return secondary_limits(self.document.vast.execution)

    @property
    def jobs_side_by_side(self) -> int:
        """Number of parallel jobs: the user's, or as many as CPUs allow."""
        if self.options.jobs is not None:
            return self.options.jobs
        asked = [self.limits, *self.secondaries.values()]
        total = sum(limits.cpus or 0 for limits in asked) or 1.0
        return max(1, int(machine_cpus() / total))

    @cached_property
    def is_imported(self) -> bool:
        """Whether the campaign was imported, and its containers are confined."""
        return is_imported(self.layout.root)

    @property
    def sets_user(self) -> bool:
        """Whether the document sets the user of the processes in a container."""
        return "run_as_user" in self.document.vast.execution.model_fields_set

    @property
    def has_display(self) -> bool:
        """Whether containers may use the display of this machine."""
        gui = not self.is_imported if self.options.gui is None else self.options.gui
        return gui and "DISPLAY" in os.environ

    @cached_property
    def user_id(self) -> int:
        """User of the processes in a container.

        The document's, if it sets one and was not imported. Otherwise the caller, so that results
        belong to the caller; for root the contract's default, since simulators refuse to run as
        root.
        """
        if self.sets_user and not self.is_imported:
            return self.document.vast.execution.run_as_user
        return os.getuid() or DEFAULT_USER

    @cached_property
    def conditions(self) -> str:
        """What all runs depend on, as a hash; empty if not all of it is known.

        It is determined before the first run, when the campaign has its copy of the shared files.
        """
        if not self.identity.content:
            return ""
        spec = self.spec(_ANY_JOB, self.layout.running)
        return common_key(
            {
                "runtime": [self.runtime.name, self.runtime.config_dir, self.identity.content],
                "environment": spec.environment,
                "user": spec.user,
                "limits": [spec.limits, spec.secondaries],
                "timeout": self.document.vast.execution.timeout,
                "network": self.options.network_host,
                "display": self.has_display,
            },
            self.layout.running / COMMON,
        )

    def keys(self, job: PackStart) -> dict[int, str]:
        """The keys of a job's runs, by id; empty texts if not all is known."""
        return run_keys(self.conditions, job, self.scenario)

    def spec(self, job: PackStart, work: Path) -> StartSpec:
        """The specification for starting a job in its work folder."""
        config, out, own = work / "config", work / "out", self.layout.job(job.name)
        unlimited = not self.options.enforce_resources
        return StartSpec(
            token=f"{self.token}.{job.name}",
            work=work,
            config=config,
            out=out,
            job=own,
            environment=self._environment(job, config, out),
            user=f"{self.user_id}:{self.user_id if self.user_id != os.getuid() else os.getgid()}",
            limits=self.limits.unenforced if unlimited else self.limits,
            secondaries={
                name: limits.unenforced if unlimited else limits
                for name, limits in self.secondaries.items()
            },
            display=self.has_display,
            confined=self.is_imported,
        )

    def _environment(self, job: PackStart, config: Path, out: Path) -> Mapping[str, str]:
        execution = self.document.vast.execution
        flags = {"-t": self.options.log_tree, "-d": self.options.debug}
        return job_environment(
            job,
            campaign=self.layout.root.name,
            scenario_file=self.document.vast.scenario_file or "",
            config_dir=self.runtime.config_dir or str(config),
            out_dir=self.runtime.out_dir or str(out),
            available_cpus=self.limits.cpus or machine_cpus(),
            available_memory=self.limits.memory or machine_memory(),
            settings={
                "PRE_COMMAND": execution.pre_command,
                "POST_COMMAND": execution.post_command,
                "SIMULATION": execution.simulation,
            },
            scenario_options=" ".join(flag for flag, given in flags.items() if given),
            user=merge_pairs(execution.env),
        )
