// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "../can/can_bus.hpp"
#include "../can/can_carrier.hpp"
#include "../file_descriptor.hpp"
#include "exchange.hpp"
#include "own_carriers.hpp"
#include "r4link/can/can_ids.hpp"

namespace r4 {
namespace {

struct TimedFrame {
  CanFrame frame;
  CanMedium::Clock::time_point at;
};

// As in SocketCAN, few frames wait here, because they can be neither replaced nor overtaken.
struct FrameOutbox {
  using Item = TimedFrame;
  static constexpr std::size_t most = 8;

  std::optional<Item> next(CanMedium::Clock::time_point now) {
    for (std::deque<Item>* const lane : {&first, &rest}) {
      while (!lane->empty()) {
        const Item item = lane->front();
        lane->pop_front();
        if (lane == &first || now - item.at <= CanBus::patience) return item;
      }
    }
    return std::nullopt;
  }
  void clear() {
    first.clear();
    rest.clear();
  }

  std::deque<Item> first;
  std::deque<Item> rest;
};

CanFrame frame_of(std::uint32_t id, bool extended, bool fd, std::string_view data) {
  CanFrame frame{};
  if (data.size() > (fd ? max_fd_size : max_classic_size)) {
    throw Error(
        ErrorKind::usage, fmt::format("a CAN frame of {} bytes", data.size()),
        fmt::format("its data are longer than {} bytes", fd ? max_fd_size : max_classic_size),
        fd ? "" : "pass fd = true for a CAN FD frame");
  }
  frame.id = id;
  frame.extended = extended;
  frame.fd = fd;
  frame.size = static_cast<std::uint8_t>(data.size());
  std::memcpy(frame.data, data.data(), data.size());
  return frame;
}

struct FrameCalls {
  template <class Received>
  void open(Received received) {
    bus->open([received = std::move(received)](std::uint32_t id, bool extended, bool fd,
                                               std::string_view data) {
      received({frame_of(id, extended, fd, data), CanMedium::Clock::now()});
    });
  }
  void send(const TimedFrame& item) {
    const CanFrame& frame = item.frame;
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): the bytes of a frame
    const auto* const data = reinterpret_cast<const char*>(frame.data);
    bus->send(frame.id, frame.extended, frame.fd, {data, frame.size});
  }
  void close() { bus->close(); }

  std::shared_ptr<OwnCanBus> bus;
};

// The exchange reopens the bus by itself: a later open() only checks whether the bus is open.
class OwnCanMedium final : public CanMedium {
 public:
  explicit OwnCanMedium(std::shared_ptr<OwnCanBus> bus)
      : name_(bus->name()),
        news_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
        exchange_(std::make_shared<Exchange<FrameCalls, FrameOutbox>>(
            name_, std::make_unique<FrameCalls>(FrameCalls{std::move(bus)}),
            std::make_unique<FrameOutbox>(), [this] { ::eventfd_write(news_.get(), 1); })) {}
  ~OwnCanMedium() override { exchange_->end(); }

  const std::string& name() const override { return name_; }
  void open() override {
    if (!news_) throw Error(problem(EMFILE));
    if (!std::exchange(started_, true)) {
      exchange_->start();
    } else if (!exchange_->up()) {
      throw Error(problem(EIO));
    }
    open_ = true;
  }
  void close() noexcept override { open_ = false; }
  int number() const override { return open_ ? news_.get() : -1; }
  Problem problem(int error) const override {
    Problem problem = exchange_->problem();
    problem.thing = name_;
    if (error != EIO) problem.reason = std::strerror(error);
    return problem;
  }
  int receive(std::array<Received, batch>& frames) override {
    eventfd_t ignored = 0;
    ::eventfd_read(news_.get(), &ignored);
    for (const TimedFrame& each : exchange_->take()) came_.push_back(each);
    std::size_t count = 0;
    for (; count < batch && !came_.empty(); ++count, came_.pop_front()) {
      frames[count] = Received{came_.front().frame, 0, false, came_.front().at};
    }
    // The next call takes the rest.
    if (!came_.empty()) ::eventfd_write(news_.get(), 1);
    if (count != 0) return static_cast<int>(count);
    return exchange_->up() ? -EAGAIN : -EIO;
  }
  Outcome send(const CanFrame* frames, std::size_t count, std::size_t& sent) override {
    sent = 0;
    const bool up = exchange_->send([&](FrameOutbox& outbox) {
      for (; sent < count && outbox.rest.size() < FrameOutbox::most; ++sent) {
        outbox.rest.push_back({frames[sent], Clock::now()});
      }
    });
    return outcome_of(up, sent == count);
  }
  Outcome send_first(const CanFrame& frame) override {
    bool taken = false;
    const bool up = exchange_->send([&](FrameOutbox& outbox) {
      taken = outbox.first.size() < FrameOutbox::most;
      if (taken) outbox.first.push_back({frame, Clock::now()});
    });
    return outcome_of(up, taken);
  }
  std::uint32_t overflows() const override {
    return static_cast<std::uint32_t>(exchange_->overflows());
  }

 private:
  static Outcome outcome_of(bool up, bool taken) {
    if (!up) errno = EIO;
    return !up ? Outcome::failed : taken ? Outcome::done : Outcome::full;
  }

  const std::string name_;
  const FileDescriptor news_;
  std::deque<TimedFrame> came_;
  bool started_ = false;
  bool open_ = false;
  const std::shared_ptr<Exchange<FrameCalls, FrameOutbox>> exchange_;
};

}  // namespace

std::unique_ptr<Carrier> make_own_can_carrier(asio::io_context& io, std::shared_ptr<OwnCanBus> bus,
                                              const OwnCanNode& node, Role role) {
  if (node.node < 0 || node.node >= static_cast<int>(can_nodes)) {
    throw Error(ErrorKind::usage, fmt::format("node {}", node.node), "the node is out of range",
                fmt::format("give 0 to {}", can_nodes - 1));
  }
  return make_can_carrier_on(
      io,
      {role, static_cast<std::uint8_t>(node.node), node.fd, node.pack,
       fmt::format("{}, node {}", bus->name(), node.node)},
      [&io, bus] { return CanBus::on(io, std::make_unique<OwnCanMedium>(bus)); });
}

}  // namespace r4
