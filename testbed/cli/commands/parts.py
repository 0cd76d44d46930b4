"""What there is to choose from."""

from __future__ import annotations

from testbed.cli.options import Output, PluginModules, expanded


@expanded
def list_parts(output: Output, plugin: PluginModules = None) -> None:
    """List motions, sensors, filters, presets, beliefs, bands, drift models and papers."""
    from testbed.cli.catalogue import catalogue, print_catalogue

    found = catalogue(plugin or ())
    output.show(found, lambda: print_catalogue(found))
