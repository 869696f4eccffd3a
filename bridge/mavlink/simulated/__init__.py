"""A simulated rover that speaks MAVLink as a vehicle, with the protocol behaviour of one autopilot.

`vehicle` joins the parts: `transfers` is its end of the mission protocol, `vehicle_store` its stored state,
`vehicle_clock` its time, `rover` its pose, `auto_mission` and `auto_reports` its mission in AUTO,
`guided_target` its target in the guided mode, `command_handlers` its commands, `vehicle_telemetry` its
reports, `camera` its scanner. All of them handle messages; `vehicle_process` alone handles sockets.
"""
