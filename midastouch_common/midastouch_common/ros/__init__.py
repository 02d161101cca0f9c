"""What the nodes of every package share: QoS, parameters, message conversions, diagnostics, spinning."""
