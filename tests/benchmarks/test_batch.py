"""The studies of catalogs: the simulation obeys its limits, and the measured runs run."""

import numpy as np
import pytest

from dyehouse.benchmarks import batch

JOB = np.array([0.8, 1.0, 1.2])


def test_few_workers_are_limited_by_themselves():
    for workers in (1, 10):
        assert batch.simulate(workers, 1, JOB, 1e-4, 5000) == pytest.approx(workers, rel=0.03)


def test_many_workers_are_limited_by_the_scheduler():
    assert batch.simulate(1000, 1, JOB, 0.01, 5000) == pytest.approx(100, rel=0.01)
    assert batch.simulate(1000, 4, JOB, 0.01, 5000) == pytest.approx(400, rel=0.01)


def test_photos_and_jobs(tmp_path):
    batch.photos(tmp_path / "p", 3, (96, 128))
    codes = [path.read_bytes() for path in sorted((tmp_path / "p").glob("*.jpg"))]
    assert len(set(codes)) == 3
    jobs = batch.jobs_of(tmp_path / "p", "mask=mask.png", most=2)
    assert [len(job.wants) for job in jobs] == [5, 5]
    batch.run_codec(jobs[:1], 1)
    seen = []
    batch.run_batch(jobs, 1, sheets=False, watch=seen.append)
    assert seen == list(range(10))
