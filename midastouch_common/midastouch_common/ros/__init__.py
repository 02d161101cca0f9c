"""Common code of the nodes of every package: QoS, parameters, message conversions, diagnostics, spinning."""
