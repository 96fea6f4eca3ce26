"""What a file of a recording may have gone through, and how a reader refuses it."""

from refusals import refused

from stixel_cli.recordings.find import find_recording


def text(content: str):
    """Damage: this text in place of the file's."""
    return lambda file: file.write_text(content)


GIT_LFS = text("version https://git-lfs.github.com/spec/v1\noid sha256:00\n")


def missing(file):
    file.unlink()


def put(row: int, column: int | slice, word: str | list[str]):
    """Damage: another word, or words, in a table whose columns are apart by spaces."""

    def damage(file):
        rows = [line.split(" ") for line in file.read_text().splitlines()]
        rows[row][column] = word
        file.write_text("\n".join(" ".join(words) for words in rows))

    return damage


def cut(size: int | float):
    """Damage: the first `size` bytes, or that share of them, are left."""

    def damage(file):
        data = file.read_bytes()
        file.write_bytes(data[: size if isinstance(size, int) else int(size * len(data))])

    return damage


def is_refused(source, said: str, name: str) -> None:
    """One line with the words `said` and the `name` of a file or folder."""
    with refused(said, name):
        find_recording(source)
