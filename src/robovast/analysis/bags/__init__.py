"""ROS bags without ROS: what a run recorded, as CSV tables and videos.

```
files.py, mcap_file.py, sqlite_file.py   messages of a bag, whatever is left of it
definitions.py                           what a message type consists of, from the bag itself
flatten.py, table.py                     messages as cells, cells as a CSV file
transforms.py                            the transform tree over the whole time of a bag
topics.py, tf.py, behaviors.py, actions.py, rosout.py, video.py    one job each
convert.py                               all jobs of a run, in one pass over each of its bags
commands.py                              the same as post-processing commands of a .vast file
```
"""
