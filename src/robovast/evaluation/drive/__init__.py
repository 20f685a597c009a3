"""A recorded drive, read in parts so that a large bag is played at once (extra `ros`).

```
blocks.py      where the messages of an MCAP file are, by time and topic
recording.py   the messages of a bag's files by time
roles.py       which topic tells what: pose, scan, plan, …
clock.py       the time line that people see
motion.py      poses of the robot, and what its laser sees
events.py      log messages and behaviours that change
ground.py      map, obstacles and goals
drives.py      the answers: what a drive has, and one part of it
```
"""
