"""Items of several groups, taken in turn: no group waits for all items of another one."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Rotation(Generic[T]):
    """A queue for each group; the groups take turns."""

    def __init__(self) -> None:
        self._groups: OrderedDict[str, deque[T]] = OrderedDict()
        """The items of each group that has some; the group whose turn is next comes first."""
        self._last = ""
        """The group of the last item. Groups that get an item before the next `take` precede it."""

    def add(self, group: str, item: T) -> None:
        """Add an item at the end of its group; a group without items gets the last turn."""
        self._groups.setdefault(group, deque()).append(item)

    def take(self, may: Callable[[str], bool] = lambda _: True) -> T | None:
        """Remove and return the next item; None if there is none.

        Args:
            may: whether a group may have a turn; a group that may not keeps its place.
        """
        if self._last in self._groups:
            self._groups.move_to_end(self._last)
        group = next(filter(may, self._groups), None)
        if group is None:
            return None
        self._last = group
        items = self._groups[group]
        item = items.popleft()
        if not items:
            del self._groups[group]
        return item
