// SPDX-License-Identifier: GPL-3.0-or-later
// The end of a shared transport in the program that holds it. Sends a copy of every datagram to the
// first most_served programs that send hello, and obeys a stop of any program. A program that
// stopped the board is served beyond that limit, to see the result. A slow program loses copies.
#pragma once

#include <asio/io_context.hpp>
#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "../operation_slot.hpp"
#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "r4link/options.hpp"
#include "share_message.hpp"

namespace r4 {

class ShareHolder {
 public:
  static constexpr std::size_t most_served = 16;
  static constexpr std::size_t most_served_after_a_stop = 20;
  // Programs of any user that connect repeatedly take at most a few percent of the loop's time.
  static constexpr std::chrono::microseconds between_arrivals{300};

  // Called on the loop's thread. Any of these calls may release the holder.
  class Owner {
   public:
    // The events that a new program must know: whether the transport is up, and its trouble.
    virtual std::vector<CarrierEvent> standing() const = 0;
    // Another program has sent this valid E:STOP.
    virtual void on_stop_of_another(std::string_view datagram) = 0;
    // A controlling program requests the transport.
    virtual void on_asked() = 0;

   protected:
    ~Owner() = default;
  };

  ShareHolder(asio::io_context& io, Owner& owner)
      : io_(io), owner_(owner), listener_(io), accept_timer_(io) {}
  ~ShareHolder() { release(); }
  ShareHolder(const ShareHolder&) = delete;
  ShareHolder& operator=(const ShareHolder&) = delete;

  // Takes the name of `role`. False, with errno: EADDRINUSE if another program has the name.
  bool hold(const ShareName& name, BoardRole role);
  void release() noexcept;

  bool holds() const { return listener_.is_open(); }
  std::size_t served() const;
  // Sends to all served programs. Masks secrets in a copy.
  void tell(ShareMessage::Kind kind, std::string_view text);

 private:
  class Sharer;

  void listen();
  void accept();
  void on_message(Sharer& from, const std::optional<ShareMessage>& message);
  void on_hello(Sharer& from);
  void serve(Sharer& sharer);

  asio::io_context& io_;
  Owner& owner_;
  ShareName name_;
  LoopDescriptor listener_;
  OperationSlot accepting_;
  LoopTimer accept_timer_;
  std::vector<std::shared_ptr<Sharer>> sharers_;  // ended sharers are removed at the next arrival
};

}  // namespace r4
