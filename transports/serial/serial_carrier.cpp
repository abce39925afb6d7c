// SPDX-License-Identifier: GPL-3.0-or-later
#include "serial_carrier.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <asio/post.hpp>
#include <chrono>
#include <cstring>
#include <utility>
#include <vector>

#include "line_carrier.hpp"
#include "port_list.hpp"
#include "serial_device.hpp"

namespace r4 {
namespace {

constexpr long default_baud = 1'000'000;
constexpr long min_baud = 9600;
constexpr long max_baud = 12'000'000;
constexpr std::chrono::milliseconds look_again{100};
constexpr int looks_before_warning = 5;

// The path to open. Throws Error if a search finds no device or several.
std::string find_device(const Url& url) {
  const std::string number = url.get("sn").value_or("");
  if (number.empty() && url.path() != "auto") return url.path();
  std::vector<SerialPort> ports = list_serial_ports();
  std::erase_if(ports, [&](const SerialPort& port) {
    return number.empty() ? !port.is_r4 : port.serial_number != number;
  });
  if (ports.empty()) {
    throw Error(ErrorKind::open, url.text(),
                number.empty()
                    ? "no R4 board is connected by USB"
                    : fmt::format("no device with serial number '{}' is connected", number),
                "connect the board and switch it on; r4 list shows the serial ports");
  }
  if (ports.size() > 1) {
    std::string list;
    for (const SerialPort& port : ports) {
      list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", url_of(port), port.path);
    }
    throw Error(ErrorKind::usage, url.text(), "several boards are connected", "use one of " + list);
  }
  return ports.front().path;
}

class SerialCarrier final : public LineCarrier {
 public:
  SerialCarrier(asio::io_context& io, Url url, Claim claim);
  ~SerialCarrier() override { close(); }

  void open(Handler& handler) override;
  void close() noexcept override;
  SendResult send(std::string_view bytes, Priority priority, Peer to) override;

 private:
  void look() override;
  Problem on_lost(int error) override;
  bool may_read() override;

  std::string find_again() const;
  void open_device(const std::string& path);

  const Url url_;
  const unsigned baud_;
  SerialPort device_;     // the device opened last
  std::string obstacle_;  // why the port cannot be reopened although it exists
  int obstructed_ = 0;    // consecutive looks with that obstacle
  const Claim claim_;
  PortLock lock_;
  OperationSlot yielding_;
};

SerialCarrier::SerialCarrier(asio::io_context& io, Url url, Claim claim)
    : LineCarrier(io, url.text(), look_again),
      url_(std::move(url)),
      baud_(static_cast<unsigned>(url_.get_number("baud", min_baud, max_baud, default_baud))),
      claim_(std::move(claim)) {
  url_.allow_only("baud sn");
  const bool by_number = !url_.get("sn").value_or("").empty();
  const bool by_path = url_.path() == "auto" || url_.path().find('/') != std::string::npos;
  if (!url_.host().empty() || by_number == by_path || (by_number && !url_.path().empty())) {
    throw Error(ErrorKind::usage, url_.text(), "the URL does not name a serial port",
                url_.host().empty()
                    ? "use serial:auto, serial:///dev/NAME or serial:?sn=SERIAL"
                    : "write a path with three slashes: serial:///dev/" + url_.host());
  }
}

void SerialCarrier::open(Handler& handler) {
  close();
  open_device(find_device(url_));
  claim_->takes = false;  // at the next opening, another program may have a right to the device
  handler_ = &handler;
  report_up();
}

void SerialCarrier::close() noexcept {
  yielding_.cancel();
  LineCarrier::close();
}

SendResult SerialCarrier::send(std::string_view bytes, Priority priority, Peer to) {
  if (claim_->yields && up() && lock_.is_taken()) {
    asio::post(io_, yielding_.handler([this] { may_read(); }));
    return SendResult::down;
  }
  return LineCarrier::send(bytes, priority, to);
}

// Another program may have taken the port while this program was stopped.
bool SerialCarrier::may_read() {
  if (!lock_.is_taken()) return true;
  close();
  if (claim_->on_taken) claim_->on_taken();
  return false;
}

// The path of the device opened last. Some adapters share one serial number.
std::string SerialCarrier::find_again() const {
  if (device_.serial_number.empty()) return find_device(url_);
  std::string path;
  for (const SerialPort& port : list_serial_ports()) {
    if (port.serial_number != device_.serial_number || port.vid != device_.vid ||
        port.pid != device_.pid) {
      continue;
    }
    if (path.empty() || port.path == device_.path) path = port.path;
  }
  if (path.empty()) throw Error(ErrorKind::open, name_, "the device is not connected");
  return path;
}

void SerialCarrier::open_device(const std::string& path) {
  start(open_serial_device(io_, path, baud_, *claim_, lock_), path, claim_->yields);
  name_ = "serial://" + path;
  if (baud_ != default_baud) name_ += fmt::format("?baud={}", baud_);
  const std::string real_path = resolve_links(path);
  for (const SerialPort& port : list_serial_ports()) {
    if (port.path == real_path) device_ = port;
  }
}

Problem SerialCarrier::on_lost(int error) {
  yielding_.cancel();
  obstructed_ = 0;
  return {ErrorKind::open, name_,
          error == 0
              ? "unplugged, or closed at the other end"
              : fmt::format("unplugged, or closed at the other end ({})", std::strerror(error)),
          "plug it in again; the port is then opened automatically"};
}

void SerialCarrier::look() {
  std::string path;
  try {
    path = find_again();
    open_device(path);
  } catch (const Error& error) {
    look_later();
    // A missing device was reported. A device that exists but cannot be opened needs a warning.
    const bool there = !path.empty() && ::access(path.c_str(), F_OK) == 0;
    if (!there || error.what() != obstacle_) obstructed_ = 0;
    obstacle_ = error.what();
    if (there && ++obstructed_ == looks_before_warning) {
      handler_->on_carrier_event({CarrierEvent::Kind::warning, error.problem()});
    }
    return;
  }
  report_up();
}

}  // namespace

std::unique_ptr<Carrier> make_serial_carrier(asio::io_context& io, const Url& url, Role,
                                             Claim claim) {
  return std::make_unique<SerialCarrier>(io, url, std::move(claim));
}

ShareName serial_share_name(const Url& url) {
  const std::string path = resolve_links(find_device(url));
  for (const SerialPort& port : list_serial_ports()) {
    if (port.path == path && port.is_r4 && !port.serial_number.empty()) {
      return {"serial/sn=" + port.serial_number};
    }
  }
  return {"serial/" + path, {}, true};
}

}  // namespace r4
