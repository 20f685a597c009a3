"""Compatibility with files of the existing tool: classes under the names that they import.

| imported as | is |
| --- | --- |
| `robovast.results_processing.postprocessing_plugins.BasePostprocessingPlugin` | base of commands |
| `robovast_nav.gui.MapVisualizer` | drawing on a map, in notebooks |
| `robovast_nav.variation.….<Type>` | the navigation variation types |
"""
