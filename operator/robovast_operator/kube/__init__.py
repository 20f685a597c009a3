"""The cluster as the operator sees it: client, watched objects, lease, work queue.

`kubernetes.aio` logs in, renews tokens and holds the connections. It takes 10 MiB and 0.25 s of CPU
at the start (69 MiB after imports instead of 59); a request costs as much as by aiohttp alone, 0.3
ms. Ours are, and why:

- `api`: objects stay JSON, a page at a time. A page of 200 Jobs takes 4 ms so, and 49 ms as classes
  of the package, the first time 490 ms and 17 MiB. And a replica that may not lead writes nothing.
- `lease`: the election of the package does not check before each write whether the Lease is still
  held, measures by a clock that can be set, and does not give the Lease back at the end.
- `store` and `resync`: kopf's index keeps what was deleted while its watch was away.

kopf, in `__main__` alone, holds the watches and ends the process; it writes nothing.
"""
