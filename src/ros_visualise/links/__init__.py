"""Links to vehicles: MAVLink, as PX4 and ArduPilot speak it.

Of the two libraries for Python, pymavlink is used, by its codec alone:

- it reads and writes every message of all dialects, and so the frames of ``.tlog`` files too;
  MAVSDK has them only as JSON over a connection that it opens by itself, and no files
- a frame that is damaged, signed or unknown is seen as such; MAVSDK drops it unseen, while a lossy
  link is something that a person must know
- heartbeats, times and the component's number are ours to send: MAVSDK sends its own

Its price is its size (93 MB, nearly all of it other dialects) and its licence, LGPL, which leaves
a program that imports it free. Its connections (``mavutil``) are not used: they block, and lose
the address of a peer that comes back. MAVSDK is the other end in the tests.

Only this room imports pymavlink; see `ros_visualise.links.mavlink`.
"""
