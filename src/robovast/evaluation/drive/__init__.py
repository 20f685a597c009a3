"""A recorded drive, read in parts so that a large bag is played at once (extra `ros`).

```
blocks.py      where the messages of an MCAP file are, by time and topic
recording.py   the messages of a bag's files by time
finding.py     which bag of a run is played, and which topics its document names
roles.py       which topic tells what: pose, scan, plan, …
clock.py       the time line that people see
motion.py      poses of the robot, and what its laser sees
pictures.py    what its camera sees
events.py      log messages and behaviours that change
ground.py      map, obstacles and goals
maps.py        maps of many configurations, and where their runs ended
part.py        one part of a drive
drives.py      what drives have, and their parts
```
"""
