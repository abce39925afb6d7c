// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "../board_end.hpp"
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

// As in SocketCAN, few frames wait here. In the order of sending:
//     stop     never expires; a new stop replaces its waiting duplicate, or the oldest of eight
//     urgent   flow control, and the frame of a board that went safe
//     rest     the frames of transfers, which can be neither replaced nor overtaken
struct FrameOutbox {
  using Item = TimedFrame;
  using Lane = std::deque<Item>;
  static constexpr std::size_t most = 8;

  static bool push(Lane& lane, const CanFrame& frame) {
    if (lane.size() == most) return false;
    lane.push_back({frame, CanMedium::Clock::now()});
    return true;
  }
  void push_stop(const CanFrame& frame) {
    std::erase_if(stop, [&](const Item& item) {
      return item.frame.id == frame.id && item.frame.extended == frame.extended;
    });
    if (stop.size() == most) stop.pop_front();
    push(stop, frame);
  }
  std::optional<Item> next(CanMedium::Clock::time_point now) {
    for (Lane* const lane : {&stop, &urgent, &rest}) {
      while (!lane->empty()) {
        const Item item = lane->front();
        lane->pop_front();
        if (lane == &stop || now - item.at <= CanBus::patience) return item;
      }
    }
    return std::nullopt;
  }
  void clear() {
    for (Lane* const lane : {&stop, &urgent, &rest}) lane->clear();
  }

  Lane stop, urgent, rest;
};

CanFrame frame_of(std::uint32_t id, bool extended, bool fd, std::string_view data) {
  CanFrame frame{};
  if (data.size() > (fd ? max_fd_size : max_classic_size)) {
    throw Error(ErrorKind::usage, fmt::format("a CAN frame of {} bytes", data.size()),
                fmt::format("the data of the frame are longer than {} bytes",
                            fd ? max_fd_size : max_classic_size),
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

using FrameExchange = Exchange<FrameCalls, FrameOutbox>;

// An exchange and the descriptor by which a loop waits for its news. Throws std::system_error.
struct FrameSource {
  explicit FrameSource(std::shared_ptr<OwnCanBus> bus)
      : name(bus->name()),
        news(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
        exchange(std::make_shared<FrameExchange>(
            name, std::make_unique<FrameCalls>(FrameCalls{std::move(bus)}),
            std::make_unique<FrameOutbox>(), [this] { wake(); })) {
    if (!news) throw std::system_error(errno, std::generic_category());
  }

  void wake() const { ::eventfd_write(news.get(), 1); }

  const std::string name;
  const FileDescriptor news;
  const std::shared_ptr<FrameExchange> exchange;
};

class OwnCanMedium final : public CanMedium {
 public:
  explicit OwnCanMedium(std::shared_ptr<FrameSource> source) : source_(std::move(source)) {}

  const std::string& name() const override { return source_->name; }
  void open() override {
    source_->exchange->start();
    source_->wake();  // for frames that arrived before this call
    open_ = true;
  }
  void close() noexcept override { open_ = false; }
  int number() const override { return open_ ? source_->news.get() : -1; }
  Problem problem(int) const override {
    Problem problem = source_->exchange->problem();
    problem.thing = source_->name;
    return problem;
  }
  // Reports a failure first, because CanBus waits for the next event after frames.
  int receive(std::array<Received, batch>& frames) override {
    eventfd_t ignored = 0;
    ::eventfd_read(source_->news.get(), &ignored);
    if (!source_->exchange->up()) return -EIO;
    int count = 0;
    for (const TimedFrame& each : source_->exchange->take(batch)) {
      frames[static_cast<std::size_t>(count++)] = Received{each.frame, 0, false, each.at};
    }
    return count == 0 ? -EAGAIN : count;
  }
  Outcome send(const CanFrame* frames, std::size_t count, std::size_t& sent) override {
    sent = 0;
    const bool up = source_->exchange->send([&](FrameOutbox& outbox) {
      while (sent < count && FrameOutbox::push(outbox.rest, frames[sent])) ++sent;
    });
    return outcome_of(up, sent == count);
  }
  Outcome send_first(const CanFrame& frame) override {
    bool taken = true;
    const bool up = source_->exchange->send([&](FrameOutbox& outbox) {
      if (classify(frame).kind == CanIdKind::emergency_stop) {
        outbox.push_stop(frame);
      } else {
        taken = FrameOutbox::push(outbox.urgent, frame);
      }
    });
    return outcome_of(up, taken);
  }
  std::uint32_t overflows() const override {
    return static_cast<std::uint32_t>(source_->exchange->overflows());
  }

 private:
  static Outcome outcome_of(bool up, bool taken) {
    if (!up) errno = EIO;
    return !up ? Outcome::failed : taken ? Outcome::done : Outcome::full;
  }

  const std::shared_ptr<FrameSource> source_;
  bool open_ = false;
};

// The source outlives a CanBus that could not be opened, and ends with the carrier.
class OwnCanCarrier final : public Carrier, public BoardEnd {
 public:
  OwnCanCarrier(asio::io_context& io, const CanCarrierOptions& options,
                std::shared_ptr<OwnCanBus> bus)
      : bus_(std::move(bus)), carrier_(make_can_carrier_on(io, options, [this, &io] {
          if (!source_) source_ = std::make_shared<FrameSource>(bus_);
          return CanBus::on(io, std::make_unique<OwnCanMedium>(source_));
        })) {}
  ~OwnCanCarrier() override { close(); }

  void open(Handler& handler) override { carrier_->open(handler); }
  void close() noexcept override {
    carrier_->close();
    if (source_) source_->exchange->end();
    source_.reset();
  }
  SendResult send(std::string_view bytes, Priority priority, Peer to) override {
    return carrier_->send(bytes, priority, to);
  }
  bool is_shared() const override { return carrier_->is_shared(); }
  bool up() const override { return carrier_->up(); }
  TransportTrouble trouble() const override { return carrier_->trouble(); }
  const std::string& name() const override { return carrier_->name(); }
  const CarrierCounters& counters() const override { return carrier_->counters(); }
  void use_packed_form(bool wanted) override { board_end_of(*carrier_).use_packed_form(wanted); }

 private:
  const std::shared_ptr<OwnCanBus> bus_;
  std::shared_ptr<FrameSource> source_;  // from the first open() to close()
  const std::unique_ptr<Carrier> carrier_;
};

}  // namespace

std::unique_ptr<Carrier> make_own_can_carrier(asio::io_context& io, std::shared_ptr<OwnCanBus> bus,
                                              const OwnCanNode& node, Role role) {
  if (node.node < 0 || node.node >= static_cast<int>(can_nodes)) {
    throw Error(ErrorKind::usage, fmt::format("node {}", node.node), "the node is out of range",
                fmt::format("give 0 to {}", can_nodes - 1));
  }
  const CanCarrierOptions options{role, static_cast<std::uint8_t>(node.node), node.fd, node.pack,
                                  fmt::format("{}, node {}", bus->name(), node.node)};
  return std::make_unique<OwnCanCarrier>(io, options, std::move(bus));
}

}  // namespace r4
