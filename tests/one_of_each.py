"""A plugin of pytest: of a parametrized test, the first case alone."""


def pytest_collection_modifyitems(items):
    items[:] = {item.nodeid.partition("[")[0]: item for item in reversed(items)}.values()
    items.reverse()
