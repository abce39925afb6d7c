// SPDX-License-Identifier: GPL-3.0-or-later
// How whole datagrams travel: the interface that every transport implements.
//
// A carrier moves datagrams like UDP does: it may lose and reorder them, it never blocks, and it
// never corrupts silently (the datagram's CRC is checked above it). It lives on one event loop (Loop, or
// an io_context of Asio's) and is used from that loop's thread only. The first open() throws when the
// transport cannot be opened; after that, trouble is an event, and the carrier comes back by itself when the
// device does.
#pragma once

#include <chrono>
#include <cstddef>
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

// Which end of the link a carrier serves: a host calls out to a board, a board listens for hosts.
enum class Role : std::uint8_t { host, board };

enum class SendResult : std::uint8_t {
  sent,  // handed to the system, or waiting for it
  full,  // the queue is full: try again later
  down,  // the transport is down at the moment, or nobody is known at the other end
  busy,  // not sent, for another host commands the board from the same place (CAN)
};

// Why datagrams do not pass although the transport is up (CAN).
enum class WireTrouble : std::uint8_t {
  none,
  // frames that make no R4 datagram come on the board's command id: another protocol uses it
  foreign_frames,
  late_frames,  // flow control does not come in time: frames are held back, or lost
};
// "none", "foreign frames", "late frames".
R4LINK_API const char* to_text(WireTrouble trouble);

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

// "up", "down", "warning".
constexpr const char* to_text(CarrierEvent::Kind kind) {
  switch (kind) {
    case CarrierEvent::Kind::up:
      return "up";
    case CarrierEvent::Kind::down:
      return "down";
    case CarrierEvent::Kind::warning:
      break;
  }
  return "warning";
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
    virtual void on_datagram(std::string_view bytes, Peer from) = 0;  // `bytes` valid in the call
    virtual void on_carrier_event(const CarrierEvent& event) = 0;
    // All datagrams that had arrived have been handed over: to be called whenever that is so. A handler
    // that was held up can tell by it which state of a backlog is the newest. Behind a long burst on a
    // byte stream it may come with the next datagram only.
    virtual void on_drained() {}
    // What another program sent to the board, on a wire that programs share.
    virtual void on_overheard(std::string_view bytes) { static_cast<void>(bytes); }
    // Another program has taken the device (Claim::yields): this carrier has closed it.
    virtual void on_taken() {}
    // The first 1024 bytes of a line or packet that was longer, and so no datagram; the rest is thrown away.
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

  // Sends one datagram (no terminator). Never blocks; `bytes` are copied if they must wait. A
  // datagram that could not be written within 100 ms is dropped and counted.
  virtual SendResult send(std::string_view bytes, Priority priority, Peer to = everyone) = 0;

  // At a board: that peer is in control. It keeps its number, however many others send, until another peer is
  // held. Where nothing reaches everyone at once (UDP), what is sent to everyone goes to it. `everyone`: nobody
  // on this carrier is in control any more.
  virtual void hold(Peer peer) { static_cast<void>(peer); }
  // It is that peer, too, for it is heard from several places: held beside the first until another is held.
  virtual void also_hold(Peer peer) { static_cast<void>(peer); }

  // At a board: does that peer get what is sent to everyone?
  virtual bool reaches(Peer peer) const { return peer == everyone; }

  // Is it a bus (CAN), on which what a board says is heard by all, and all its hosts send from one place? Then who
  // only watches sends nothing but stops and leases (W), and a board asks for no proof of those.
  virtual bool is_shared() const { return false; }

  // Sends the packed form from now on, where there is one (CAN). Received are both at any time.
  virtual void use_packed_form(bool wanted) { static_cast<void>(wanted); }

  // Of a device that one program can have open at a time: how the next open() takes it.
  struct Claim {
    bool yields =
        false;  // it may be taken from this program, which then reads and sends nothing more
    bool takes = false;  // also from a program that yields
  };
  virtual void claim(Claim claim) { static_cast<void>(claim); }

  // At a host that records and does not drive, before open(): what comes may be handed over some milliseconds late, so
  // that many boards wake the processor up no more often than one. A carrier that does so tells when it came.
  virtual void gather() {}
  // Of the datagram that is being handed over: when it came, unless that is now.
  virtual std::optional<std::chrono::steady_clock::time_point> arrival() const {
    return std::nullopt;
  }

  virtual bool up() const = 0;
  // At a host: as it is now.
  virtual WireTrouble trouble() const { return WireTrouble::none; }
  // The longest datagram it carries, in bytes.
  virtual std::size_t max_size() const = 0;
  // For people: the URL, with what `auto` found.
  virtual const std::string& name() const = 0;
  virtual const CarrierCounters& counters() const = 0;
};

// Makes a transport of your own for the loop of a board's thread, not yet open. What it does there must
// not block: while it does, nothing is sent. `loop` outlives it.
using CarrierMaker = std::function<std::unique_ptr<Carrier>(Loop& loop)>;

}  // namespace r4
