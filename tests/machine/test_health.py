import shutil

from stixel_cli.config import folders
from stixel_cli.machine import kernels


def test_the_probe_casts_rays_even_if_another_renderer_is_the_default(tmp_path, monkeypatch):
    conf = shutil.copytree(folders.shipped_folder("conf"), tmp_path / "conf")
    chosen = (conf / "config.yaml").read_text(encoding="utf-8")
    assert "renderer: raycast" in chosen
    (conf / "config.yaml").write_text(chosen.replace("renderer: raycast", "renderer: filament"))
    monkeypatch.setattr(folders, "shipped_folder", tmp_path.joinpath)
    kernels.render_tiny_picture()
