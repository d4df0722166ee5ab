import pytest

import service


def pytest_configure(config):
    config.addinivalue_line("markers", "step: a part of one story; what follows builds on it")


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    outcome = yield
    report = outcome.get_result()
    if report.failed:
        output = service.run("journalctl", "-b", "--no-pager", "-o", "short-monotonic", "-n", "120",
                             check=False).stdout
        report.sections.append(("journal of the guest", output))


@pytest.fixture(scope="session")
def machine():
    """Module and controller for all tests; the first test installs the service."""
    made = service.Machine()
    yield made
    made.close()


@pytest.fixture
def running(machine):
    """The compensating service with a settled offset of 9 um."""
    service.write_config(machine.config())
    if not service.active():
        service.start()
    service.wait_for_mode("compensating")
    machine.settled_at(9.0)
    return machine
