"""Shares: places where finished campaigns lie as `<campaign>.tar.gz`.

A provider for each kind of place is a plugin of the group `robovast.share_providers`.
"""
