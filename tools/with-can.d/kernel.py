# SPDX-License-Identifier: GPL-3.0-or-later
"""Debian's kernel, prepared for QEMU once and kept in the user's cache.

apt-get download fetches the package, which needs no root. The cache has the kernel as an ELF file,
which QEMU boots directly, in half the time. It also has an initial RAM disk with busybox and the
modules.
The first program makes them, under a lock, in a folder that gets its name when it is complete.
"""
import fcntl
import glob
import hashlib
import io
import lzma
import os
import pathlib
import platform
import shutil
import struct
import subprocess
import sys
import tarfile
import tempfile
import time

from trouble import Trouble

FORMAT = 2  # version of the cached folder: a new number if older programs cannot use it
PACKAGE = 'linux-image-amd64'
BUSYBOX = '/bin/busybox'
BASE_MODULES = ('virtio_pci', '9pnet_virtio', '9p', 'virtio_console')
CAN_MODULES = ('can-raw', 'can-bcm', 'can-isotp', 'can-gw', 'can-dev', 'vcan', 'vxcan', 'slcan',
               'sch_netem', 'sch_tbf', 'kvaser_pci')
USB_MODULES = ('xhci-pci', 'ftdi_sio')
XZ_MAGIC = b'\xfd7zXZ\x00'
ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
DEBIANS = 'take a linux-image-*-amd64 package of Debian 12 or 13'
GIVEN_IS = 'set R4_CAN_KERNEL to the path of a Debian linux-image-*-amd64 package, or leave it out'


class Kernel:
    """The two files that QEMU boots."""

    def __init__(self, folder):
        self.vmlinux = folder / 'vmlinux'
        self.initrd = folder / 'initrd'


def cache_folder():
    base = os.environ.get('XDG_CACHE_HOME') or os.path.join(os.path.expanduser('~'), '.cache')
    return pathlib.Path(base) / 'r4link' / 'with-can'


def prepared():
    """Returns the kernel; prepares it if the cache does not have it."""
    cache = cache_folder()
    ready = cache / (f'kernel-{FORMAT}' + mark_of_given())
    if not ready.is_dir():
        try:
            cache.mkdir(parents=True, exist_ok=True)
            with open(cache / 'lock', 'w', encoding='ascii') as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                if not ready.is_dir():
                    prepare(cache, ready)
        except OSError as error:
            raise Trouble(str(error.filename or cache), error.strerror or str(error),
                          'set XDG_CACHE_HOME to a folder you may write to, with 200 MB left') from error
    return Kernel(ready)


def mark_of_given():
    """A suffix that distinguishes the kernel of R4_CAN_KERNEL from other kernels and earlier versions of the file."""
    given = os.environ.get('R4_CAN_KERNEL')
    if not given:
        return ''
    try:
        state = os.stat(given)
    except OSError as error:
        raise Trouble(f'R4_CAN_KERNEL={given}', error.strerror, GIVEN_IS) from error
    which = f'{os.path.realpath(given)} {state.st_size} {state.st_mtime_ns}'
    return '-' + hashlib.sha256(os.fsencode(which)).hexdigest()[:16]


def prepare(cache, ready):
    if platform.machine() != 'x86_64':
        raise Trouble('the guest', f'there is none for a {platform.machine()} machine',
                      'load the vcan module here: sudo modprobe vcan')
    for leftover in cache.glob('making-*'):
        shutil.rmtree(leftover, ignore_errors=True)
    making = pathlib.Path(tempfile.mkdtemp(prefix='making-', dir=cache))
    package = fetched(cache)
    print(f'with-can: unpacking {package.name}', file=sys.stderr)
    try:
        image, modules, built_in = unpacked(package)
    except (tarfile.TarError, EOFError, ValueError) as error:
        own = package.parent == cache
        raise Trouble(str(package), f'it cannot be unpacked: {error}',
                      f'rm {package}, then run this again' if own else GIVEN_IS) from error
    (making / 'vmlinux').write_bytes(elf_inside(package, image))
    (making / 'initrd').write_bytes(initial_ram_disk(modules, built_in))
    making.chmod(0o755)
    making.rename(ready)
    if package.parent == cache:
        package.unlink()


def fetched(cache):
    """Returns the file of the package; downloads it if it is missing."""
    given = os.environ.get('R4_CAN_KERNEL')
    if given:
        if not os.path.isfile(given):
            raise Trouble(f'R4_CAN_KERNEL={given}', 'it is not a file', GIVEN_IS)
        return pathlib.Path(given)
    if shutil.which('apt-get') is None or shutil.which('dpkg-deb') is None:
        raise Trouble('the guest\'s kernel', 'it is a Debian package, and this system is not Debian',
                      'set R4_CAN_KERNEL to the path of a Debian linux-image-*-amd64 package')
    depends = subprocess.run(['apt-cache', 'depends', PACKAGE], capture_output=True, text=True,
                             check=False).stdout
    names = [line.split()[1] for line in depends.splitlines() if line.startswith('  Depends: ')]
    if not names:
        raise Trouble(PACKAGE, 'the package lists do not have it',
                      'sudo apt-get update; on another system than Debian set R4_CAN_KERNEL to the '
                      'path of a Debian linux-image-*-amd64 package')
    print(f'with-can: downloading {names[0]} (70 MB, once)', file=sys.stderr)
    for pause in (5, 15, 30, 0):  # a name that cannot be resolved may be resolved a minute later
        done = subprocess.run(['apt-get', '-q', '-o', 'Acquire::Retries=3', 'download', names[0]], cwd=cache,
                              check=False, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              errors='replace')
        if done.returncode == 0 or 'Temporary failure' not in done.stderr:
            break
        time.sleep(pause)
    found = sorted(glob.glob(f'{cache}/{names[0]}_*.deb'), key=os.path.getmtime)
    if done.returncode != 0 or not found:
        said = [line for line in done.stderr.splitlines() if line.startswith('E:')]
        raise Trouble(names[0], 'it cannot be downloaded: ' +
                      (said[0][2:].strip() if said else f'apt-get ended with {done.returncode}'),
                      'look at the network and run sudo apt-get update, then run this again; or set '
                      'R4_CAN_KERNEL to the path of the package')
    return pathlib.Path(found[-1])


def unpacked(package):
    """Returns the compressed kernel, the modules by name, and the names of the modules built into the kernel."""
    image = None
    modules = {}
    built_in = set()
    wanted = ('/kernel/net/9p/', '/kernel/fs/', '/kernel/net/can/', '/kernel/drivers/net/can/',
              '/kernel/drivers/virtio/', '/kernel/drivers/char/', '/kernel/drivers/usb/',
              '/kernel/net/sched/', '/kernel/lib/')
    with subprocess.Popen(['dpkg-deb', '--fsys-tarfile', package], stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL) as unpacking, \
            tarfile.open(fileobj=unpacking.stdout, mode='r|') as files:
        for each in files:
            if each.isfile() and each.name.startswith('./boot/vmlinuz-'):
                image = files.extractfile(each).read()
            elif each.isfile() and each.name.endswith('/modules.builtin'):
                built_in = {name_of(line.decode()) for line in files.extractfile(each).read().split()}
            elif each.isfile() and each.name.endswith(('.ko', '.ko.xz')) and \
                    any(folder in each.name for folder in wanted):
                content = files.extractfile(each).read()
                modules[name_of(each.name)] = lzma.decompress(content) if content.startswith(XZ_MAGIC) else content
        unpacking.stdout.read()
    if image is None:
        raise ValueError('it has no boot/vmlinuz-*')
    return image, modules, built_in


def name_of(path):
    """The name of a module: dri_ver for dri-ver.ko.xz."""
    return os.path.basename(path).split('.', 1)[0].replace('-', '_')


def elf_inside(package, image):
    """Returns the kernel itself, which bzImage contains, compressed by xz (Debian 12) or zstd (Debian 13)."""
    # Documentation/arch/x86/boot.rst: setup_sects, payload_offset, payload_length
    payload = b''
    if len(image) > 0x250:
        start, length = struct.unpack_from('<II', image, 0x248)
        start += (image[0x1f1] + 1) * 512
        payload = image[start:start + length]
    elf = b''
    if payload.startswith(XZ_MAGIC):
        try:
            elf = lzma.LZMADecompressor().decompress(payload)
        except lzma.LZMAError:
            pass
    elif payload.startswith(ZSTD_MAGIC):
        if shutil.which('zstd') is None:
            raise Trouble('zstd', 'it is not installed', 'tools/setup --can')
        # The kernel's build appends four bytes: the size.
        elf = subprocess.run(['zstd', '-dcq'], input=payload[:-4], capture_output=True, check=False).stdout
    if not elf.startswith(b'\x7fELF'):
        raise Trouble(str(package), 'its kernel is not compressed by xz or zstd', DEBIANS)
    return elf


def in_loading_order(modules, built_in, names):
    """The modules that are not built into the kernel, each after the modules that it depends on."""
    order = []

    def add(name):
        name = name_of(name)
        if name in built_in:
            return
        if name not in modules:
            raise Trouble(f'module {name}', 'the kernel package does not have it', DEBIANS)
        at = modules[name].find(b'\0depends=')
        depends = modules[name][at + 9:modules[name].index(b'\0', at + 9)].decode()
        for each in filter(None, depends.split(',')):
            add(each)
        if name not in order:
            order.append(name)

    for name in names:
        add(name)
    return order


def initial_ram_disk(modules, built_in):
    try:
        busybox = pathlib.Path(BUSYBOX).read_bytes()
    except OSError as error:
        raise Trouble(BUSYBOX, error.strerror, 'tools/setup --can') from error
    if b'/lib64/ld-linux' in busybox[:4096]:
        raise Trouble(BUSYBOX, 'it is not linked statically', 'sudo apt-get install busybox-static')
    base, can, usb = (in_loading_order(modules, built_in, names)
                      for names in (BASE_MODULES, CAN_MODULES, USB_MODULES))
    can = [name for name in can if name not in base]
    disk = Cpio()
    for folder in ('bin', 'modules'):
        disk.add(folder, 0o040755)
    disk.add('bin/busybox', 0o100755, busybox)
    disk.add('bin/sh', 0o120777, b'busybox')
    for name in base + can + usb:
        disk.add(f'modules/{name}.ko', 0o100644, modules[name])
    for name, loaded in (('base', base), ('can', can), ('usb', usb)):
        disk.add(f'modules/{name}', 0o100644, '\n'.join(loaded).encode() + b'\n')
    return disk.closed()


class Cpio:
    """An archive in the "newc" format, as the kernel unpacks it. Several archives may follow each other."""

    def __init__(self):
        self._bytes = io.BytesIO()
        self._count = 0

    def add(self, path, mode, content=b''):
        self._count += 1
        name = os.fsencode(path) + b'\0'
        fields = (self._count, mode, 0, 0, 1, 0, len(content), 0, 0, 0, 0, len(name), 0)
        self._put(b'070701' + b''.join(b'%08X' % field for field in fields) + name)
        self._put(content)

    def _put(self, content):
        self._bytes.write(content)
        self._bytes.write(b'\0' * (-len(content) % 4))

    def closed(self):
        self.add('TRAILER!!!', 0)
        return self._bytes.getvalue()
