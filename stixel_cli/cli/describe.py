"""`stixel describe`: explain groups, options and keys, to people and to editors."""

from pathlib import Path

from stixel_cli.cli import options
from stixel_cli.cli.terminal import print_table, say
from stixel_cli.config import folders
from stixel_cli.config.texts import split_override
from stixel_cli.errors import ConfigurationError, UserError


def describe(
    name: options.argument(
        str | None,
        "A group, an option as GROUP=OPTION (also MODULE:FUNCTION), a key, or a metric. "
        "Without it: all groups.",
        "NAME",
        options.complete_setting,
    ) = None,
    schema: options.option(
        Path | None,
        "Write JSON Schemas of presets, experiments, sweeps and studies into this folder.",
        "FOLDER",
    ) = None,
) -> int:
    """Explain a setting or a metric, or list all groups.

    It prints the meaning with its unit, range, default, options, and the stages that read the
    setting; of a metric, which values are better and what it is compared with.

    With JSON Schemas an editor completes and checks a YAML file that begins, for example, with
    `# yaml-language-server: $schema=schema/sweep.json`, a path from that file.

    \b
    Examples:
      stixel describe tracker.sigma_f
      stixel describe iou_mean
      stixel describe --schema schema
    """
    from stixel_cli.border.origins import write_below, written
    from stixel_cli.config.keys import known_keys
    from stixel_cli.config.messages import unknown_key
    from stixel_cli.evaluation.metric_table import METRICS
    from stixel_cli.export.json_schemas import schema_files

    group, option = split_override(name or "")
    group = group.replace(".", "/") if group.replace(".", "/") in folders.group_options() else group
    if schema is not None:
        if name is not None:
            raise UserError(f"--schema writes all schemas: leave out {name}")
        files = schema_files()
        with written(schema):
            write_below(schema, files)
        say(*(str(schema / file) for file in sorted(files)))
    elif name is None:
        _print_groups()
    elif name in METRICS:
        _print_metric(name)
    elif group in known_keys():
        _print_key(group)
    elif group not in folders.group_options():
        raise ConfigurationError(unknown_key(group, others=METRICS))
    elif "=" in name:
        _print_option(group, option)
    else:
        _print_group(group)
    return 0


def _print_groups() -> None:
    from stixel_cli.config.keys import groups, meaning_of_group, settings_of_top

    rows = []
    for name in groups():
        options = " ".join([*folders.options_of_kind(name), *_installed(name)])
        rows.append((name, options, meaning_of_group(name)))
    print_table(("group", "options (default first)", "meaning"), rows)
    say("")
    tops = [(key.name, key.default, key.meaning) for key in settings_of_top()]
    print_table(("key", "default", "meaning"), tops)
    say("", "stixel describe GROUP, GROUP=OPTION or KEY explains one of them.")


def _print_group(group: str) -> None:
    from stixel_cli.config.keys import meaning_of_group, meaning_of_option
    from stixel_cli.experiment.table import readers

    rows = [("read by", ", ".join(readers(group.replace("/", "."))) or "no stage")]
    print_table((group, meaning_of_group(group)), rows)
    say("")
    options = folders.options_of_kind(group)
    texts = [(f"{group}={option}", meaning_of_option(group, option)) for option in options]
    print_table(("option (default first)", "meaning"), texts)
    say("")
    _print_keys(group, folders.default_option(group))


def _print_option(group: str, option: str) -> None:
    from stixel_cli.config.keys import meaning_of_option
    from stixel_cli.config.messages import unknown_option
    from stixel_cli.config.own_options import parameters_of_own, user_function

    if user_function(group, option):
        columns = (f"key of {group}={option}", "default", "range", "meaning")
        print_table(columns, parameters_of_own(group, option))
    elif option in folders.group_options()[group]:
        say(f"{group}={option}: {meaning_of_option(group, option)}", "")
        _print_keys(group, option)
    else:
        raise ConfigurationError(unknown_option(group, option))


def _print_keys(group: str, option: str) -> None:
    from stixel_cli.config.keys import keys_of_option

    keys = keys_of_option(group, option)
    if rows := [(key.name, key.values.get(option, ""), key.meaning) for key in keys]:
        print_table((f"key of {group}={option}", "value", "meaning"), rows)
    else:
        say(f"{group}={option} has no keys.")


def _print_key(name: str) -> None:
    from stixel_cli.config.keys import describe_key
    from stixel_cli.experiment.table import readers

    for i, key in enumerate(describe_key(name)):
        if i:
            say("")
        default, values = key.default, key.values
        if len(set(values.values())) > 1:
            default = ", ".join(f"{value} ({option})" for option, value in values.items())
        rows = [("range", key.range), ("default", default)]
        rows.append(("belongs to", " ".join(key.belongs_to)))
        rows.append(("of installed packages", " ".join(_installed(name))))
        rows.append(("read by", ", ".join([*readers(name), *key.followers]) or "no stage"))
        print_table((name, key.meaning), [row for row in rows if row[1]])


def _print_metric(name: str) -> None:
    from stixel_cli.evaluation.metric_table import BASELINES, METRICS

    row = METRICS[name]
    low, high = ("" if bound is None else f"{bound:g}" for bound in row.bounds)
    least, most = row.expected
    limits = ((least, "below"), (most, "above"))
    better = {"less": "less", "more": "more", "one": "near 1, as a factor"}
    rows = [
        ("unit", row.unit),
        ("range", f"{low} to {high}" if high else f"{low} or more" if low else ""),
        ("better", better.get(row.better, "no value is better")),
        ("compared with", BASELINES.get(name, "")),
        ("verdict names it", ", ".join(f"{w} {v:.2g}" for v, w in limits if v is not None)),
        ("over runs", row.over_runs or "the mean, with its 95 % interval"),
    ]
    print_table((name, row.label), [row for row in rows if row[1]])


def _installed(name: str) -> list[str]:
    """The functions of installed packages that are options of a group or values of a key."""
    return [*folders.installed_functions(name)] if name in folders.ENTRY_POINTS else []
