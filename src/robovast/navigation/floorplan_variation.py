"""Floor plans: each gives configurations a map and a mesh of their own."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from robovast.common.config import get_validated_config
from robovast.common.variation import ProvContribution
from robovast.errors import DocumentError, InputError
from robovast.navigation.base import Config, NavigationConfig, NavigationVariation, with_record
from robovast.navigation.extra import nav_extra

if TYPE_CHECKING:
    from robovast.navigation.floorplan.artefacts import Artefacts
    from robovast.navigation.floorplan.model import FloorPlan

Files = Annotated[list[str], Field(min_length=1)]
Container = Annotated[str, Field(min_length=1)] | None


class FloorplanGenerationConfig(NavigationConfig):
    """Parameters of FloorplanGeneration."""

    name: Annotated[list[str], Field(min_length=1, max_length=2)]
    """Scenario parameters that get the map's file and the mesh's, in this order."""
    floorplans: Files
    """Models of floor plans (.fpm), relative to the .vast file; one configuration for each."""
    container: Container = None
    """Image of a generator to use instead of the one in this process."""


class FloorplanVariationConfig(NavigationConfig):
    """Parameters of FloorplanVariation."""

    name: Annotated[list[str], Field(min_length=1, max_length=2)]
    """Scenario parameters that get the map's file and the mesh's, in this order."""
    variation_files: Files
    """What varies in floor plans (.variation), relative to the .vast file."""
    num_variations: Annotated[int, Field(ge=1)]
    """Number of plans to draw for each of the files."""
    seed: int | None = None
    """Seed; without one it follows from the configuration's name."""
    container: Container = None
    """Image of a generator to use instead of the one in this process."""


@dataclass(frozen=True)
class _Plan:
    """A plan to make files of."""

    name: str
    """Of its files."""
    model: Path
    """Its model."""
    about: dict[str, Any]
    drawn: FloorPlan | None = None
    """The plan, when it is already known."""
    base: Path | None = None
    """The model that it was drawn from."""


class _FloorplanVariation(NavigationVariation):
    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._models: list[Path] = []
        self._drawn: set[Path] = set()

    def variation(self, in_configs: list[Config]) -> list[Config]:
        """Each configuration with each floor plan."""
        for name in self.parameters.name:
            self.reference(f"@{name}")
        with nav_extra(type(self).__name__):
            try:
                made = list(self._made())
            except DocumentError as error:
                raise DocumentError(replace(p, key=self._where) for p in error.problems) from None
            except InputError as error:
                raise InputError(f"{self._where}: {error}") from None
        return [
            self._with_plan(config, plan, artefacts)
            for config in in_configs
            for plan, artefacts in made
        ]

    @property
    def _where(self) -> str:
        return f"configuration `{self.entry}`: {self._name}"

    @property
    def _name(self) -> str:
        return type(self).__name__

    @classmethod
    def get_required_container(cls, parameters: Any) -> str | None:
        """The generator's image, when one is named."""
        image = parameters.get("container")
        return image if isinstance(image, str) and image else None

    def _made(self) -> Iterator[tuple[_Plan, Artefacts]]:
        make = self._generated if self.container_runner else self._made_here
        for plan in self._plans():
            self.progress_update(plan.name)
            yield plan, make(plan)

    def _made_here(self, plan: _Plan) -> Artefacts:
        from robovast.navigation.floorplan.artefacts import make_artefacts
        from robovast.navigation.floorplan.language import read_floorplan

        return make_artefacts(plan.drawn or read_floorplan(plan.model), plan.name, self._folder)

    def _generated(self, plan: _Plan) -> Artefacts:
        from robovast.navigation.floorplan.generator import generate

        return generate(self.container_runner, plan.model, plan.name, self._folder)

    def get_input_files(self) -> list[str]:
        """The models that are below the .vast file's folder."""
        return [str(path) for path in self._models if self._is_input(path)]

    def get_campaign_transient_files(self) -> list[tuple[str, str]]:
        """The models that are not: those that were drawn, and those from elsewhere."""
        return [
            (f"floorplans/{path.name}", str(path))
            for path in self._models
            if not self._is_input(path)
        ]

    @classmethod
    def collect_prov_metadata(
        cls,
        config_entry: dict[str, Any],
        campaign_namespace: Any,
        config_namespace: Any,
        gen_activity_id: str,
        vast_id: str,
    ) -> ProvContribution | None:
        """The floor plan, what was made of it, and by what."""
        del gen_activity_id
        from robovast.navigation.provenance import floorplan_contribution

        return floorplan_contribution(config_entry, campaign_namespace, config_namespace, vast_id)

    def _plans(self) -> Iterator[_Plan]:
        raise NotImplementedError

    def _read(self, path: Path) -> FloorPlan:
        from robovast.navigation.floorplan.language import read_floorplan

        self._models.append(path)
        return read_floorplan(path)

    @cached_property
    def _folder(self) -> Path:
        if self.output_dir is None:
            raise InputError("an output folder is needed")
        return Path(self.output_dir)

    def _is_input(self, path: Path) -> bool:
        return path not in self._drawn and path.is_relative_to(Path(self.base_path).resolve())

    def _in_campaign(self, path: Path) -> str:
        """Where a model is in a campaign."""
        if self._is_input(path):
            return f"_config/{path.relative_to(Path(self.base_path).resolve())}"
        return f"_transient/floorplans/{path.name}"

    def _generator(self) -> dict[str, Any]:
        """What to record of a generator that is not ours."""
        runner = self.container_runner
        return {"generator": {"image": runner.image, "digest": runner.digest}} if runner else {}

    def _with_plan(self, config: Config, plan: _Plan, artefacts: Artefacts) -> Config:
        files = (artefacts.map_file, artefacts.mesh_file)
        record = {
            "name": plan.name,
            "model": self._in_campaign(plan.model),
            "base": self._in_campaign(plan.base) if plan.base else None,
            "map_file": artefacts.map_file,
            "image": artefacts.image,
            "mesh_file": artefacts.mesh_file,
            "graph": list(artefacts.graph),
            "resolution": artefacts.resolution,
            **self._generator(),
            **plan.about,
        }
        return self.update_config(
            config,
            dict(zip(self.parameters.name, files, strict=False)),
            artefacts.files,
            with_record(config, map_file=artefacts.map_file, floorplan=record),
        )


class FloorplanGeneration(_FloorplanVariation):
    """A map and a mesh of each of several floor plans."""

    CONFIG_CLASS = FloorplanGenerationConfig

    def _plans(self) -> Iterator[_Plan]:
        from robovast.navigation.floorplan.about import read_about

        names: dict[str, str] = {}
        for file in self.parameters.floorplans:
            path = (Path(self.base_path) / file).resolve()
            if path.stem in names:
                raise InputError(
                    f"`{names[path.stem]}` and `{file}` have one name, and "
                    "their maps would; rename one of them."
                )
            names[path.stem] = file
            self._models.append(path)
            yield _Plan(path.stem, path, read_about(path))


class FloorplanVariation(_FloorplanVariation):
    """Floor plans drawn by the distributions of .variation files, each with a map and a mesh."""

    CONFIG_CLASS = FloorplanVariationConfig

    @classmethod
    def most_of_each(cls, parameters: Any, base_path: str) -> int | None:
        """As many as are drawn of all files."""
        del base_path
        given = get_validated_config(parameters, FloorplanVariationConfig)
        return len(given.variation_files) * given.num_variations

    def _plans(self) -> Iterator[_Plan]:
        from robovast.navigation.floorplan.about import read_about
        from robovast.navigation.floorplan.sampling import read_variation

        for file in self.parameters.variation_files:
            path = (Path(self.base_path) / file).resolve()
            plan, distributions = read_variation(path, self._read)
            self._models.append(path)
            for number in range(1, self.parameters.num_variations + 1):
                rng = self.generator(self.parameters.seed, file, number)
                try:
                    drawn = distributions.draw(plan, rng)
                except DocumentError as error:
                    raise InputError(
                        f"{path}: no sound floor plan was found for variation {number}: {error}\n"
                        "    Narrow the distributions."
                    ) from None
                about = read_about(distributions.base)
                yield self._written(f"{path.stem}_{number}", drawn, about, distributions.base)

    def _written(self, stem: str, plan: FloorPlan, about: dict[str, Any], base: Path) -> _Plan:
        """A drawn plan as a model of its own, under a name that no other plan has."""
        from robovast.navigation.floorplan.text import write_floorplan

        text = write_floorplan(plan)
        name = f"{stem}_{hashlib.sha256(text.encode()).hexdigest()[:6]}"
        path = self._folder / f"{name}.fpm"
        path.write_text(f"// drawn from {os.path.basename(base)}\n{text}", encoding="utf-8")
        self._models.append(path)
        self._drawn.add(path)
        return _Plan(name, path, about, plan, base)
