"""Responses about recorded drives."""

from __future__ import annotations

from collections.abc import Mapping
from threading import Lock
from typing import TYPE_CHECKING, Any

from starlette.requests import Request
from starlette.responses import Response

from robovast.base.errors import InputError
from robovast.base.optional_deps import ROS
from robovast.evaluation.drive.bag_discovery import PlayerTopics, bag_of, read_named
from robovast.evaluation.library import Library
from robovast.evaluation.map_picture import RECORD, entries
from robovast.evaluation.notebooks.workloads import Target
from robovast.evaluation.run import run_record
from robovast.evaluation.server.answers import Attached, Data
from robovast.evaluation.untrusted_data import mapping

if TYPE_CHECKING:
    from robovast.evaluation.drive.drives import Drive, Drives


class DrivePages:
    """Responses about the drives of a results folder."""

    def __init__(self, library: Library) -> None:
        self._library = library
        self._results = library.results
        self._opened: Drives | None = None
        self._lock = Lock()

    def drive(self, request: Request) -> Response:
        """What a run's drive has; without a recording that can be read, its map alone."""
        from robovast.evaluation.drive.ground import configured_ground, planned

        ROS.require("Playing a drive")
        campaign, variant, run = _names(request)
        place = f"{campaign}/{variant}/{run}"
        self._library.bring(place)
        named = self._named(campaign)
        remarks = [named.fault] if named.fault else []
        drive: Drive | None = None
        try:
            drive = self._drive(place, named)
        except InputError as error:
            remarks.append(str(error))
        entry = entries(self._results, campaign, [variant]).get(variant, {})
        navigation = mapping(entry.get(RECORD))
        ground, missing = configured_ground(self._results, campaign, variant, navigation)
        if ground is None and drive is not None:
            try:
                ground = drive.ground()
            except InputError as error:
                remarks.append(str(error))
        if ground is None:
            remarks.append(f"Without a map: {missing}")
        record = run_record(self._results, place)
        return Data(
            {
                "overview": drive and drive.overview(),
                "ground": ground,
                "planned": planned(navigation, mapping(entry.get("config"))),
                "verdict": record.get("verdict"),
                "remarks": remarks,
            }
        )

    def maps(self, request: Request) -> Response:
        """Maps of some configurations, and where their runs ended."""
        from robovast.base.optional_deps import NAV

        with NAV.needed_by("The map of a configuration"):
            from robovast.evaluation.drive.maps import configuration_maps

        self._library.require_all("The map of a configuration")
        variants = request.query_params.getlist("variant")
        return Data(configuration_maps(self._results, request.path_params["campaign"], variants))

    def failures(self, request: Request) -> Response:
        """Where the runs of a campaign ended that did not pass, on their maps."""
        from robovast.base.optional_deps import NAV

        with NAV.needed_by("A map of failures"):
            from robovast.evaluation.drive.maps import failure_places

        self._library.require_all("A map of failures")
        name = request.path_params["campaign"]
        variants = self._library.campaign(name).variants
        return Data(failure_places(self._results, name, variants))

    def part(self, request: Request) -> Response:
        """One part of a run's drive."""
        ROS.require("Playing a drive")
        campaign, variant, run = _names(request)
        drive = self._drive(f"{campaign}/{variant}/{run}", self._named(campaign))
        scans = request.query_params.get("scans") == "1"
        return Data(drive.part(request.path_params["part"], scans=scans))

    def pictures(self, request: Request) -> Response:
        """What the camera saw in one part of a run's drive."""
        ROS.require("Playing a drive")
        campaign, variant, run = _names(request)
        drive = self._drive(f"{campaign}/{variant}/{run}", self._named(campaign))
        found = drive.pictures(request.path_params["part"])
        return Attached(found, found.content)

    def _named(self, campaign: str) -> PlayerTopics:
        return read_named(Target(self._results, (campaign,)))

    def _drive(self, place: str, named: PlayerTopics) -> Drive:
        self._library.bring(place)
        bag = bag_of(self._results, place, named)
        return self._drives().drive(bag, named.topics)

    def _drives(self) -> Drives:
        from robovast.evaluation.drive.drives import Drives

        with self._lock:
            self._opened = self._opened or Drives(self._results)
            return self._opened


def _names(request: Request) -> tuple[str, str, int]:
    names: Mapping[str, Any] = request.path_params
    return names["campaign"], names["variant"], names["run"]
