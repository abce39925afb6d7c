// SPDX-License-Identifier: GPL-3.0-or-later
#include "serial_device.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <libserialport.h>
#include <linux/serial.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <asio/serial_port.hpp>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>

#include "port_list.hpp"
#include "r4link/error.hpp"

namespace r4 {
namespace {

std::string ports_in_words() {
  std::string list;
  for (const SerialPort& port : list_serial_ports()) {
    list += (list.empty() ? "" : ", ") + port.path;
    if (port.is_r4) list += " (R4)";
  }
  return list.empty() ? "this computer has no serial ports now"
                      : "serial ports of this computer: " + list;
}

[[noreturn]] void fail(const std::string& path, int error) {
  if (const auto problem = out_of_resources(path, error)) throw Error(*problem);
  switch (error) {
    case ENOENT:
    case ENODEV:
    case ENXIO:
      throw Error(ErrorKind::open, path, "the device does not exist",
                  "connect the board; " + ports_in_words());
    case EACCES:
    case EPERM:
      throw Error(ErrorKind::permission, path, "permission denied",
                  "add yourself to the dialout group: sudo usermod -aG dialout $USER, then log in "
                  "again");
    case EBUSY:
    case EWOULDBLOCK:
      throw Error(ErrorKind::open, path, "the port is in use by another program",
                  "end that program; fuser -v " + path + " names it");
    case ENOTTY:
    case EINVAL:
    case EISDIR:
      throw Error(ErrorKind::open, path, "this file is not a serial port", ports_in_words());
    default:
      throw Error(ErrorKind::open, path, std::strerror(error), "unplug it and plug it in again");
  }
}

[[noreturn]] void refuse_baud(const std::string& path, unsigned baud) {
  throw Error(ErrorKind::usage, path, fmt::format("the port does not support {} baud", baud),
              "use an adapter that supports the board's rate, 1000000 baud");
}

FileDescriptor duplicate(int descriptor) {
  return FileDescriptor(::fcntl(descriptor, F_DUPFD_CLOEXEC, 0));
}

bool is_in_sysfs(const std::string& real_path) {
  const std::filesystem::path file(real_path);
  std::error_code ignored;
  return file.parent_path() == "/dev" &&
         std::filesystem::exists("/sys/class/tty" / file.filename() / "device", ignored);
}

FileDescriptor open_real(const std::string& path, const std::string& real_path, unsigned baud) {
  sp_port* found = nullptr;
  if (sp_get_port_by_name(real_path.c_str(), &found) != SP_OK) fail(path, ENOENT);
  const std::unique_ptr<sp_port, void (*)(sp_port*)> port(found, sp_free_port);
  errno = 0;
  if (sp_open(port.get(), SP_MODE_READ_WRITE) != SP_OK) fail(path, errno != 0 ? errno : EIO);
  int descriptor = -1;
  sp_get_port_handle(port.get(), &descriptor);
  FileDescriptor result = duplicate(descriptor);
  if (!result) {
    const int error = errno;
    sp_close(port.get());
    fail(path, error);
  }
  const bool plain = sp_set_bits(port.get(), 8) == SP_OK &&
                     sp_set_parity(port.get(), SP_PARITY_NONE) == SP_OK &&
                     sp_set_stopbits(port.get(), 1) == SP_OK &&
                     sp_set_flowcontrol(port.get(), SP_FLOWCONTROL_NONE) == SP_OK;
  const bool rate = plain && sp_set_baudrate(port.get(), static_cast<int>(baud)) == SP_OK;
  sp_close(port.get());
  if (!plain) fail(path, EIO);
  if (!rate) refuse_baud(path, baud);

  serial_struct settings{};
  if (::ioctl(result.get(), TIOCGSERIAL, &settings) == 0) {
    settings.flags |= ASYNC_LOW_LATENCY;
    ::ioctl(result.get(), TIOCSSERIAL, &settings);
  }
  return result;
}

FileDescriptor open_pty(asio::io_context& io, const std::string& path, unsigned baud) {
  using Port = asio::serial_port;
  asio::error_code error;
  Port port(io);
  port.open(path, error);
  if (error) fail(path, error.value());
  close_on_exec(port.native_handle());
  port.set_option(Port::character_size(8), error);
  if (!error) port.set_option(Port::parity(Port::parity::none), error);
  if (!error) port.set_option(Port::stop_bits(Port::stop_bits::one), error);
  if (!error) port.set_option(Port::flow_control(Port::flow_control::none), error);
  if (error) fail(path, error.value());
  port.set_option(Port::baud_rate(baud), error);
  if (error) refuse_baud(path, baud);
  FileDescriptor result = duplicate(port.native_handle());
  if (!result) fail(path, errno);
  return result;
}

}  // namespace

std::string resolve_links(const std::string& path) {
  std::error_code error;
  const std::filesystem::path real = std::filesystem::canonical(path, error);
  return error ? path : real.string();
}

FileDescriptor open_serial_device(asio::io_context& io, const std::string& path, unsigned baud,
                                  const DeviceClaim& claim, PortLock& lock) {
  const std::string real_path = resolve_links(path);
  const bool real = is_in_sysfs(real_path);
  FileDescriptor device = real ? open_real(path, real_path, baud) : open_pty(io, real_path, baud);
  if (!lock.lock(device.get(), claim)) fail(path, errno);
  if (real && !claim.yields && lock.is_first()) ::ioctl(device.get(), TIOCEXCL);
  // libserialport leaves VMIN at 0, and then read(2) returns 0 for "no data" as for a hang-up.
  termios settings{};
  if (::tcgetattr(device.get(), &settings) != 0) fail(path, errno);
  settings.c_cc[VMIN] = 1;
  settings.c_cc[VTIME] = 0;
  if (::tcsetattr(device.get(), TCSANOW, &settings) != 0) fail(path, errno);
  ::tcflush(device.get(), TCIFLUSH);
  return device;
}

}  // namespace r4
