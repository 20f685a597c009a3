"""Converts recorded ROS bags to CSV tables and videos, without a ROS installation.

```
files.py, mcap_file.py, sqlite_file.py   read the messages of a bag, even a damaged one
definitions.py                           message definitions, from the bag itself
flatten.py, table.py                     convert messages to cells, and cells to a CSV file
transforms.py                            the transform tree over the whole time of a bag
topics.py, tf.py, behaviors.py, actions.py, rosout.py, video.py    one kind of job each
convert.py                               executes all jobs of a run in one pass over each bag
commands.py                              the postprocessing commands for .vast files
```
"""
