"""The renders of a test session are shared by its modules; a folder that the user keeps is used as it is."""

import os

import pytest

GIVEN = os.environ.get("DYEHOUSE_CACHE")


@pytest.fixture(scope="module")
def shared_renders(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DYEHOUSE_CACHE", GIVEN or str(tmp_path_factory.getbasetemp() / "renders-fast"))
        yield patch
