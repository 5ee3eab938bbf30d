"""The graph for other viewers: Foxglove, Lichtblick and others see and steer it live.

Source: "Foxglove WebSocket protocol v1", docs/spec.md of github.com/foxglove/ws-protocol until July
2025; for playback control, the ``protocol`` module of github.com/foxglove/foxglove-sdk.
"""
