"""R-Net over the kernel's own SocketCAN, in User-Mode Linux, so that it runs where the kernel has no CAN."""

from __future__ import annotations

import importlib.util
import os
import platform
import shutil
from pathlib import Path
from types import ModuleType

import pytest

BOOT = Path(__file__).parent / "uml" / "boot.py"


@pytest.fixture
def boot() -> ModuleType:
    spec = importlib.util.spec_from_file_location("chairward_uml_boot", BOOT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    if platform.machine() != "x86_64":
        pytest.skip("Debian has user-mode-linux for x86 only")
    if not module.fetched():
        if not (os.environ.get("CI") and shutil.which("apt-get")):
            pytest.skip(f"needs user-mode-linux and busybox-static unpacked: python {BOOT} fetch")
        module.fetch()
    return module


@pytest.mark.timeout(400)
def test_the_drive_contract_holds_for_rnet_on_a_real_can_socket(boot: ModuleType) -> None:
    done = boot.run_contract()
    assert boot.GOOD in done.stdout, done.stdout[-6000:]
