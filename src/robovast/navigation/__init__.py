"""Variations for mobile robots: floor plans, paths and obstacles (extra `nav`)."""
