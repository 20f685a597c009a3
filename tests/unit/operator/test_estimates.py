"""When a campaign ends, in its status."""

from __future__ import annotations

from datetime import timedelta

from support.kube.fake_cluster import World, accepted

from robovast_operator.kube.times import parse_time


def world(**execution: object) -> World:
    made = World(accepted(execution=execution, runs=20, parallelism=5))
    made.look()
    for _ in range(10):
        made.now += timedelta(seconds=59)
        made.work()
        made.look()
    return made


def test_the_status_says_when_a_campaign_ends_from_its_first_run_on() -> None:
    made = World(accepted(runs=2, parallelism=2))
    made.look()
    assert made.status.estimate is None
    made = world(resources={"cpu": 2})
    found = made.status.estimate
    assert found is not None
    end, earliest, latest = map(parse_time, (found.end, found.earliest, found.latest))
    assert made.now < earliest < end < latest
    assert timedelta(minutes=35) < end - made.now < timedelta(minutes=60), "50 runs, one a minute"
    assert found.cpu_hours is not None
    assert 6 < found.cpu_hours < 14, "5 pods of 2 CPUs for an hour"


def test_time_alone_changes_nothing_so_that_nothing_is_written() -> None:
    made = world()
    before = made.status
    for _ in range(5):
        made.now += timedelta(minutes=1)
        made.look()
    assert made.status == before


def test_nobody_knows_when_a_suspended_campaign_ends_nor_when_an_ended_one_would() -> None:
    made = world()
    made.ask(suspend=True)
    made.look()
    assert made.status.estimate is None
    made.ask(suspend=False)
    made.settle()
    assert made.status.state == "Finished"
    assert made.status.estimate is None


def test_a_wait_in_the_queue_is_no_time_of_execution() -> None:
    made = World(accepted(runs=2, parallelism=2, queue_name="lab"))
    made.look()
    (job,) = made.jobs.values()
    job.suspended, job.queue = True, "lab"
    made.now += timedelta(hours=9)
    made.look()
    assert made.status.start_time is None
    job.suspended = False
    made.look()
    assert parse_time(str(made.status.start_time)) == made.now
    made.now += timedelta(minutes=1)
    made.work()
    made.look()
    assert made.status.estimate is not None
    assert parse_time(made.status.estimate.latest) - made.now < timedelta(hours=1)


def test_the_first_pack_does_not_promise_that_all_others_wait_for_it() -> None:
    made = World(accepted(execution={"runs_per_job": 10}, runs=20, parallelism=3))
    made.look()
    made.now += timedelta(minutes=10)
    made.work()
    made.look()
    found = made.status.estimate
    assert found is not None
    earliest, latest = parse_time(found.earliest), parse_time(found.latest)
    assert earliest < made.now + timedelta(minutes=10) < latest, "two turns of three packs"
