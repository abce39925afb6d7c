// SPDX-License-Identifier: GPL-3.0-or-later
// The interface of every transport. A carrier moves whole datagrams as UDP does: it may lose and
// reorder them, and never blocks. The receiver detects damage by the CRC. A carrier is used only on
// the thread of its event loop (Loop or io_context). The first open() throws if the transport
// cannot be opened. Later trouble is an event, and the carrier reopens when the device returns.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "config.hpp"
#include "error.hpp"
#include "vocabulary.hpp"

namespace r4 {

enum class BoardRole : std::uint8_t;

// The end of the link that a carrier serves: a host connects to a board, a board listens for hosts.
enum class Role : std::uint8_t { host, board };

enum class SendResult : std::uint8_t {
  sent,  // handed to the system, or queued
  full,  // the queue is full: try again later
  down,  // the transport is down, or the peer is not known
  busy,  // not sent, because another host sends to this board on the bus (CAN)
};

// Why datagrams do not pass although the transport is up (CAN).
enum class TransportTrouble : std::uint8_t {
  none,
  // frames on the board's command id are not R4 datagrams: another protocol uses the id
  foreign_frames,
  late_frames,  // flow control arrives too late, so frames wait or are lost
};
// "none", "foreign frames", "late frames".
R4LINK_API const char* to_text(TransportTrouble trouble);

// Counters of the transfers in both directions, if a datagram is sent in several frames (CAN).
struct TransferCounters {
  // Failed transfers, whose datagrams are lost:
  std::uint64_t wrong_sequence = 0;  // a frame was lost, duplicated or overtaken
  std::uint64_t timed_out = 0;       // a frame, or the flow control for it, did not arrive in time
  std::uint64_t overflow = 0;        // longer than max_datagram
  std::uint64_t interrupted = 0;     // another transfer began before the end
  std::uint64_t cancelled = 0;       // the bus was down or accepted no frames, or has another host
  // Ignored frames:
  std::uint64_t unexpected = 0;  // not part of a transfer
  std::uint64_t malformed = 0;
  // Received packed datagrams:
  std::uint64_t packed = 0;    // accepted
  std::uint64_t bad_form = 0;  // cannot be unpacked
};

struct CarrierCounters {
  std::uint64_t rx_datagrams = 0;
  std::uint64_t rx_bytes = 0;
  std::uint64_t rx_oversize = 0;   // dropped lines or packets that were too long
  std::uint64_t rx_foreign = 0;    // dropped packets that are not from the board's address and port
  std::uint64_t rx_overflows = 0;  // frames that the system or controller dropped unread (CAN)
  std::uint64_t tx_datagrams = 0;
  std::uint64_t tx_bytes = 0;
  std::uint64_t tx_dropped = 0;  // replaced by a newer state, expired or refused
  std::uint64_t tx_errors = 0;
  std::uint64_t downs = 0;                    // how often the transport went down
  std::uint64_t ups = 0;                      // how often the transport went up
  std::optional<TransferCounters> transfers;  // none if a datagram is one packet or line
};

inline TransferCounters& operator+=(TransferCounters& sum, const TransferCounters& more) {
  sum.wrong_sequence += more.wrong_sequence;
  sum.timed_out += more.timed_out;
  sum.overflow += more.overflow;
  sum.interrupted += more.interrupted;
  sum.cancelled += more.cancelled;
  sum.unexpected += more.unexpected;
  sum.malformed += more.malformed;
  sum.packed += more.packed;
  sum.bad_form += more.bad_form;
  return sum;
}

inline CarrierCounters& operator+=(CarrierCounters& sum, const CarrierCounters& more) {
  sum.rx_datagrams += more.rx_datagrams;
  sum.rx_bytes += more.rx_bytes;
  sum.rx_oversize += more.rx_oversize;
  sum.rx_foreign += more.rx_foreign;
  sum.rx_overflows += more.rx_overflows;
  sum.tx_datagrams += more.tx_datagrams;
  sum.tx_bytes += more.tx_bytes;
  sum.tx_dropped += more.tx_dropped;
  sum.tx_errors += more.tx_errors;
  sum.downs += more.downs;
  sum.ups += more.ups;
  if (!more.transfers) return sum;
  if (!sum.transfers) sum.transfers.emplace();
  *sum.transfers += *more.transfers;
  return sum;
}

struct CarrierEvent {
  enum class Kind : std::uint8_t { up, down, warning };
  Kind kind = Kind::warning;
  Problem problem;  // for up: only `thing`, the transport
};

// "up", "down", "warning"; "unknown" for other numbers.
constexpr const char* to_text(CarrierEvent::Kind kind) {
  switch (kind) {
    case CarrierEvent::Kind::up:
      return "up";
    case CarrierEvent::Kind::down:
      return "down";
    case CarrierEvent::Kind::warning:
      return "warning";
  }
  return "unknown";
}

class Loop {
 public:
  // Calls `function()` on the loop's thread, after earlier posts. May be called from any thread.
  virtual void post(std::function<void()> function) = 0;

 protected:
  ~Loop() = default;
};

class R4LINK_API Carrier {
 public:
  // Called on the loop's thread, never within send(). May call, but not destroy, the carrier.
  class Handler {
   public:
    // `bytes` are valid during the call. For a host, `from` is `everyone`.
    virtual void on_datagram(std::string_view bytes, Peer from) = 0;
    virtual void on_carrier_event(const CarrierEvent& event) = 0;
    // All arrived datagrams were passed on, so after a delay the newest state is known. After a
    // long burst on a byte stream, this call may follow only with the next datagram.
    virtual void on_drained() {}
    // A datagram that another program sent to the board, if the transport receives such datagrams.
    virtual void on_overheard(std::string_view bytes) { static_cast<void>(bytes); }
    // The first 1024 bytes of input that is too long for a datagram. Further bytes are dropped.
    virtual void on_oversize(std::string_view beginning) { static_cast<void>(beginning); }

   protected:
    ~Handler() = default;
  };

  virtual ~Carrier() = default;
  Carrier() = default;
  Carrier(const Carrier&) = delete;
  Carrier& operator=(const Carrier&) = delete;

  // Opens and starts to receive. `handler` must remain valid until close() or the destructor.
  // Throws Error. A transport that is up at once reports `up` before open() returns.
  virtual void open(Handler& handler) = 0;
  // Closes at once; the handler is not called afterwards. Idempotent.
  virtual void close() noexcept = 0;

  // Sends one datagram of at most max_datagram (1024) bytes, without a terminator. Never blocks;
  // copies `bytes` if the datagram must wait. A datagram that is not written within 100 ms is
  // dropped and counted, except a stop. A host sends to `everyone`.
  virtual SendResult send(std::string_view bytes, Priority priority, Peer to = everyone) = 0;

  // True if the board cannot distinguish its hosts: on a bus, or through a program that shares
  // its transport. A watcher sends only stops and leases there.
  virtual bool is_shared() const { return false; }
  // Changes to control or watch. If another program of this computer controls over the shared
  // transport, throws Error{refused} with its holder() and changes nothing. The transport may be
  // reopened within the next turns of the loop; trouble with the reopening is an event.
  virtual void change_role(BoardRole role) { static_cast<void>(role); }

  virtual bool up() const = 0;
  // Why datagrams do not pass although the transport is up; none if the reason is unknown.
  virtual TransportTrouble trouble() const { return TransportTrouble::none; }
  // The URL for people, with the device that `auto` found.
  virtual const std::string& name() const = 0;
  virtual const CarrierCounters& counters() const = 0;
};

// Makes a transport of your own, not yet open, for the loop of a board's thread. The transport must
// not block this thread, because nothing is sent meanwhile. `loop` outlives the transport.
using CarrierMaker = std::function<std::unique_ptr<Carrier>(Loop& loop)>;

}  // namespace r4
