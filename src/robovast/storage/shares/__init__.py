"""Shares: storage for finished campaigns as `<campaign>.tar.gz`.

Each kind of share is a plugin in the group `robovast.share_providers`.
"""
