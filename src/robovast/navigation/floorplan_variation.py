"""Floor plan variations: each plan gives configurations their own map and mesh."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from robovast.base.errors import DocumentError, InputError
from robovast.base.optional_deps import NAV
from robovast.model.naming import CONFIG, TRANSIENT
from robovast.model.variation_config import get_validated_config
from robovast.model.variations import ProvContribution
from robovast.navigation.base import Config, NavigationConfig, NavigationVariation, with_record
from robovast.navigation.floorplan.model import LONGEST_NAME

if TYPE_CHECKING:
    from robovast.navigation.floorplan.artefacts import Artefacts
    from robovast.navigation.floorplan.model import FloorPlan

Files = Annotated[list[str], Field(min_length=1)]
Container = Annotated[str, Field(min_length=1)] | None


class FloorplanGenerationConfig(NavigationConfig):
    """Parameters of FloorplanGeneration."""

    name: Annotated[list[str], Field(min_length=1, max_length=2)]
    """Scenario parameters for the map's file and the mesh's file, in this order."""
    floorplans: Files
    """Models of floor plans (.fpm), relative to the .vast file; one configuration for each."""
    container: Container = None
    """Image of an external generator that replaces the built-in one."""


class FloorplanVariationConfig(NavigationConfig):
    """Parameters of FloorplanVariation."""

    name: Annotated[list[str], Field(min_length=1, max_length=2)]
    """Scenario parameters for the map's file and the mesh's file, in this order."""
    variation_files: Files
    """Variations of floor plans (.variation), relative to the .vast file."""
    num_variations: Annotated[int, Field(ge=1)]
    """Number of plans to draw from each file."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] | None = None
    """Seed of the first plan, incremented for each further one; by default derived from names."""
    container: Container = None
    """Image of an external generator that replaces the built-in one."""


@dataclass(frozen=True)
class _Plan:
    """A plan whose files are to be made."""

    name: str
    """Base name of its files."""
    model: Path
    """Its model."""
    about: dict[str, Any]
    drawn: FloorPlan | None = None
    """The plan, if it is already known."""
    base: Path | None = None
    """The model that it was drawn from."""

    @property
    def factors(self) -> dict[str, str]:
        """What was varied."""
        if self.base is None:
            return {"floor_plan": self.name}
        return {"floor_plan": self.base.stem, "drawn_plan": self.name}


class _FloorplanVariation(NavigationVariation):
    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._models: list[Path] = []
        self._drawn: set[Path] = set()

    def variation(self, in_configs: list[Config]) -> list[Config]:
        """Each configuration with each floor plan: plans by name, drawn ones in drawing order."""
        with NAV.needed_by(type(self).__name__):
            try:
                made = list(self._generate())
            except DocumentError as error:
                raise DocumentError(replace(p, key=self._where) for p in error.problems) from None
            except InputError as error:
                raise InputError(f"{self._where}: {error.message}", hint=error.hint) from None
        return [
            self._with_plan(config, plan, artefacts)
            for plan, artefacts in made
            for config in in_configs
        ]

    @property
    def _where(self) -> str:
        return f"configuration `{self.entry}`: {self._name}"

    @property
    def _name(self) -> str:
        return type(self).__name__

    @classmethod
    def get_required_container(cls, parameters: Any) -> str | None:
        """The generator's image, if one is given."""
        image = parameters.get("container")
        return image if isinstance(image, str) and image else None

    def _generate(self) -> Iterator[tuple[_Plan, Artefacts]]:
        make = self._generated if self.container_runner else self._generate_here
        for plan in sorted(self._plans(), key=lambda plan: (plan.base or plan.model).stem):
            self.progress_update(plan.name)
            yield plan, make(plan)

    def _generate_here(self, plan: _Plan) -> Artefacts:
        from robovast.navigation.floorplan.artefacts import make_artefacts
        from robovast.navigation.floorplan.language import read_floorplan

        return make_artefacts(plan.drawn or read_floorplan(plan.model), plan.name, self._folder)

    def _generated(self, plan: _Plan) -> Artefacts:
        from robovast.navigation.floorplan.generator import generate

        return generate(self.container_runner, plan.model, plan.name, self._folder)

    def get_input_files(self) -> list[str]:
        """The models below the .vast file's folder."""
        return [str(path) for path in self._models if self._is_input(path)]

    def get_campaign_transient_files(self) -> list[tuple[str, str]]:
        """The other models: drawn ones, and those from other folders."""
        return [
            (f"fpm/{path.name}", str(path)) for path in self._models if not self._is_input(path)
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
        """The floor plan, the files made from it, and their generator."""
        del gen_activity_id
        from robovast.navigation.provenance import floorplan_contribution

        return floorplan_contribution(config_entry, campaign_namespace, config_namespace, vast_id)

    def _plans(self) -> Iterator[_Plan]:
        raise NotImplementedError

    @cached_property
    def _folder(self) -> Path:
        if self.output_dir is None:
            raise InputError("an output folder is needed")
        return Path(self.output_dir)

    def _is_input(self, path: Path) -> bool:
        return path not in self._drawn and path.is_relative_to(Path(self.base_path).resolve())

    def _in_campaign(self, path: Path) -> str:
        """The path of a model in a campaign."""
        if self._is_input(path):
            return f"{CONFIG}/{path.relative_to(Path(self.base_path).resolve())}"
        return f"{TRANSIENT}/fpm/{path.name}"

    def _generator(self) -> dict[str, Any]:
        """The record of an external generator."""
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
            plan.factors,
        )


class FloorplanGeneration(_FloorplanVariation):
    """Makes a map and a mesh from each of several floor plans."""

    CONFIG_CLASS = FloorplanGenerationConfig

    def _plans(self) -> Iterator[_Plan]:
        from robovast.navigation.floorplan.header import read_about

        names: dict[str, str] = {}
        for file in self.parameters.floorplans:
            path = Path(os.path.realpath(Path(self.base_path) / file))
            if path.stem in names:
                raise InputError(
                    f"`{names[path.stem]}` and `{file}` have one name, and their maps would",
                    hint="rename one of them",
                )
            if len(path.stem) > LONGEST_NAME:
                raise InputError(
                    f"the name of `{path.name[:20]}…` is too long for its map",
                    hint=f"rename the file, to at most {LONGEST_NAME} characters",
                )
            names[path.stem] = file
            self._models.append(path)
            yield _Plan(path.stem, path, read_about(path))


class FloorplanVariation(_FloorplanVariation):
    """Draws floor plans from .variation files and makes a map and a mesh from each."""

    CONFIG_CLASS = FloorplanVariationConfig

    @classmethod
    def most_of_each(cls, parameters: Any, base_path: str) -> int | None:
        """The number of plans drawn from all files."""
        del base_path
        given = get_validated_config(parameters, FloorplanVariationConfig)
        return len(given.variation_files) * given.num_variations

    def _plans(self) -> Iterator[_Plan]:
        drawn = [plan for file in self.parameters.variation_files for plan in self._drawn_by(file)]
        yield from sorted(drawn, key=lambda plan: plan.name)

    def _drawn_by(self, file: str) -> Iterator[_Plan]:
        from robovast.navigation.floorplan.header import read_about
        from robovast.navigation.floorplan.sampling import read_variation

        path = Path(os.path.realpath(Path(self.base_path) / file))
        distributions = read_variation(path)
        base = distributions.model.path
        self._models += [path, base]
        for number in range(self.parameters.num_variations):
            seed = (self._seed(file) + number) % 2**32
            try:
                drawn = distributions.draw(seed)
            except DocumentError as error:
                raise InputError(
                    f"{path}: no valid floor plan was found for the seed {seed}: {error}",
                    hint="narrow the distributions",
                ) from None
            yield self._written(f"{drawn.name}_{seed}", path.stem, drawn, read_about(base), base)

    def _seed(self, file: str) -> int:
        """The seed of a file's first plan."""
        if self.parameters.seed is not None:
            return int(self.parameters.seed)
        identity = f"{self.entry}/{type(self).__name__}/{file}".encode()
        return int.from_bytes(hashlib.sha256(identity).digest()[:4])

    def _written(
        self, name: str, stem: str, plan: FloorPlan, about: dict[str, Any], base: Path
    ) -> _Plan:
        """Write a drawn plan as its own model; `stem` is that of the file it is drawn from."""
        from robovast.navigation.floorplan.text import write_floorplan

        text = write_floorplan(plan)
        path = self._folder / f"{name}.fpm"
        if path in self._drawn:  # another file draws from the same model, with the same seed
            name = f"{name}_{stem}"
            path = self._folder / f"{name}.fpm"
        path.write_text(f"// drawn from {os.path.basename(base)}\n{text}", encoding="utf-8")
        self._models.append(path)
        self._drawn.add(path)
        return _Plan(name, path, about, plan, base)
