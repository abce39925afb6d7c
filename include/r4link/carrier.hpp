// SPDX-License-Identifier: GPL-3.0-or-later
// How whole datagrams travel: the interface that every transport implements.
//
// A carrier moves datagrams like UDP does: it may lose and reorder them, it never blocks, and it
// never corrupts silently (the datagram's CRC is checked above it). It lives on one event loop (Loop, or
// an io_context of Asio's) and is used from that loop's thread only. The first open() throws when the
// transport cannot be opened; after that, trouble is an event, and the carrier comes back by itself when the
// device does.
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

// Which end of the link a carrier serves: a host calls out to a board, a board listens for hosts.
enum class Role : std::uint8_t { host, board };

enum class SendResult : std::uint8_t {
  sent,  // handed to the system, or waiting for it
  full,  // the queue is full: try again later
  down,  // the transport is down at the moment, or nobody is known at the other end
  busy,  // not sent, for another host commands the board from the same place (CAN)
};

// Why datagrams do not pass although the transport is up (CAN).
enum class TransportTrouble : std::uint8_t {
  none,
  // frames that make no R4 datagram come on the board's command id: another protocol uses it
  foreign_frames,
  late_frames,  // flow control does not come in time: frames are held back, or lost
};
// "none", "foreign frames", "late frames".
R4LINK_API const char* to_text(TransportTrouble trouble);

// Where a datagram travels in several frames (CAN): what became of the transfers, of both directions.
struct TransferCounters {
  // Ended a transfer, whose datagram is lost.
  std::uint64_t wrong_sequence = 0;  // a frame was lost, doubled or overtaken
  std::uint64_t timed_out = 0;       // a frame, or leave to send one, did not come in time
  std::uint64_t overflow = 0;        // longer than a datagram may be
  std::uint64_t interrupted = 0;     // another began in its place
  std::uint64_t cancelled = 0;       // the bus went down or took nothing, or another host is there
  // Frames that were passed over.
  std::uint64_t unexpected = 0;  // of no transfer
  std::uint64_t malformed = 0;
  // Packed datagrams that came.
  std::uint64_t packed = 0;    // taken
  std::uint64_t bad_form = 0;  // not what can be unpacked
};

struct CarrierCounters {
  std::uint64_t rx_datagrams = 0;
  std::uint64_t rx_bytes = 0;
  std::uint64_t rx_oversize = 0;   // lines or packets that were too long, thrown away
  std::uint64_t rx_foreign = 0;    // packets from an address that is not the board's, thrown away
  std::uint64_t rx_overflows = 0;  // frames that the system or the controller dropped, for nobody
                                   // took them in time (CAN)
  std::uint64_t tx_datagrams = 0;
  std::uint64_t tx_bytes = 0;
  std::uint64_t tx_dropped = 0;  // replaced by newer state, expired or refused
  std::uint64_t tx_errors = 0;
  std::uint64_t downs = 0;                    // times the transport was lost
  std::uint64_t ups = 0;                      // times it came (back) up
  std::optional<TransferCounters> transfers;  // none: a datagram is one packet or line
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
  Problem problem;  // for up: thing is the transport, the rest is empty
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

// The loop of a board's thread, on which its carrier lives.
class Loop {
 public:
  // Calls `function()` there, after what was posted before it. From any thread, also from there.
  virtual void post(std::function<void()> function) = 0;

 protected:
  ~Loop() = default;
};

class R4LINK_API Carrier {
 public:
  // Called on the loop's thread, never from within send(); may call anything of the carrier,
  // but must not destroy it.
  class Handler {
   public:
    // `bytes` are valid in the call. A host has one board: there `from` is `everyone`.
    virtual void on_datagram(std::string_view bytes, Peer from) = 0;
    virtual void on_carrier_event(const CarrierEvent& event) = 0;
    // All datagrams that had arrived have been handed over: to be called whenever that is so. A
    // handler that was held up can tell by it which state of a backlog is the newest. After a long
    // burst on a byte stream it may come with the next datagram only.
    virtual void on_drained() {}
    // What another program sent to the board, where that can be heard.
    virtual void on_overheard(std::string_view bytes) { static_cast<void>(bytes); }
    // The first 1024 bytes of what was longer, and so is not a datagram. The rest is thrown away.
    virtual void on_oversize(std::string_view beginning) { static_cast<void>(beginning); }

   protected:
    ~Handler() = default;
  };

  virtual ~Carrier() = default;
  Carrier() = default;
  Carrier(const Carrier&) = delete;
  Carrier& operator=(const Carrier&) = delete;

  // Opens and begins to receive. `handler` must outlive the carrier or its close(). Throws Error.
  // A transport that is up at once reports `up` before this returns.
  virtual void open(Handler& handler) = 0;
  // Stops at once; no call of the handler follows. Can be called twice.
  virtual void close() noexcept = 0;

  // Sends one datagram of at most max_datagram (1024) bytes, without a terminator. Never blocks;
  // `bytes` are copied if they must wait. A datagram that could not be written within 100 ms is
  // dropped and counted. A host has one board, to which it sends: `everyone`.
  virtual SendResult send(std::string_view bytes, Priority priority, Peer to = everyone) = 0;

  // True where the board cannot tell one host from another: on a bus, which all hosts send to from
  // one place, or through a program that shares its transport. A program that only watches sends
  // nothing there but stops and leases.
  virtual bool is_shared() const { return false; }
  // The program controls its board from now on, or watches it. Where programs of this computer
  // share the transport, only one of them can control: throws Error{refused} with its holder() if
  // another program does, and changes nothing then. Else the transport may be closed and opened
  // again, within the loop's next turns; trouble with that is an event. A transport of one program
  // has nothing to do.
  virtual void change_role(BoardRole role) { static_cast<void>(role); }

  virtual bool up() const = 0;
  // Why datagrams do not pass although the transport is up, as far as it can tell.
  virtual TransportTrouble trouble() const { return TransportTrouble::none; }
  // For people: the URL, with what `auto` found.
  virtual const std::string& name() const = 0;
  virtual const CarrierCounters& counters() const = 0;
};

// Makes a transport of your own for the loop of a board's thread, not yet open. What it does there must
// not block: while it does, nothing is sent. `loop` outlives it.
using CarrierMaker = std::function<std::unique_ptr<Carrier>(Loop& loop)>;

}  // namespace r4
