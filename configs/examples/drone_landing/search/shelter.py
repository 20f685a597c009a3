"""A variation type: wind and shelter make gusts."""

from robovast.common.variation import Variation


class Shelter(Variation):
    """Sets `gust` from the wind [m/s] and how much of it is held off."""

    def variation(self, in_configs):
        gust = 0.25 * self.parameters["wind"] * (1.0 - self.parameters["shelter"])
        return [self.update_config(config, {"gust": gust}) for config in in_configs]
