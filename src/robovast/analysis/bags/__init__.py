"""Converts recorded ROS bags to CSV tables and videos, without a ROS installation.

```
mcap_file.py, sqlite_file.py, zstd.py    find and read the messages of a file, even a damaged one
order.py, files.py                       read the messages of a bag in order of time
definitions.py                           message definitions, from the bag itself
flatten.py, table.py                     convert messages to cells, and cells to a CSV file
transforms.py                            the transform tree over the whole time of a bag
topics.py, tf.py, behaviors.py, actions.py, rosout.py, video.py    one kind of job each
convert.py                               executes all jobs of a run in one pass over each bag
commands.py                              the postprocessing commands for .vast files
```
"""
