// SPDX-License-Identifier: GPL-3.0-or-later
// Looks up the address of a host name without blocking the event loop. The system's resolver may
// block for 10 s, so each question has a detached thread. Asio's resolver would join its thread
// with the loop's destruction, and so delay the end of the program.
#pragma once

#include <asio/io_context.hpp>
#include <asio/ip/address.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../../operation_slot.hpp"
#include "r4link/error.hpp"

namespace r4 {

struct FoundHost {
  std::vector<asio::ip::address> addresses;
  std::string reason;  // why there are no addresses
  // Results of a search for boards (board_search.hpp):
  std::string board_id = {};
  std::optional<Problem> problem = {};  // why no board can be chosen; its thing is empty
};

struct HostLookup {
  // Blocks; called in a separate thread.
  using Resolve = std::function<FoundHost(const std::string& host)>;
  static FoundHost ask_system(const std::string& host);

  Resolve resolve = ask_system;
  std::chrono::milliseconds patience{5000};  // find() waits that long for an answer
  std::chrono::milliseconds retry{1000};     // from a failed question to the next
  std::chrono::milliseconds silence{3000};   // silence before a board is looked up again

  // `host`: a name or an address. Blocks, at most for `patience`.
  FoundHost find(const std::string& host) const;
};

// The address to use: IPv4 first, as on the board's WiFi. Throws Error about `thing` if none.
asio::ip::address address_of(const FoundHost& found, const std::string& host,
                             const std::string& thing);

bool is_address(const std::string& host);

// Requests a board's address until it is known, and again when the board is silent.
class HostWatch {
 public:
  HostWatch(const HostWatch&) = delete;
  HostWatch& operator=(const HostWatch&) = delete;
  ~HostWatch() { stop(); }

  using Question = std::function<FoundHost()>;  // blocks; called in a separate thread
  // Called on the loop with each answer. Returns true if the address is known now.
  using OnFound = std::function<bool(const FoundHost&)>;
  // `question` is called on the loop. If it returns none, `on_found` gets an empty answer at once.
  HostWatch(asio::io_context& io, HostLookup lookup, std::function<Question()> question,
            OnFound on_found);
  // Asks at once unless the address is `known`.
  void start(bool known);
  // No call follows. An open question continues in its thread, and its answer is dropped.
  void stop();

  // True if heard() has an effect.
  bool listens() const { return !heard_; }
  void heard() { heard_ = true; }

 private:
  struct Asked;
  void ask();
  void wait();

  asio::io_context& io_;
  const HostLookup lookup_;
  const std::function<Question()> question_;
  const OnFound on_found_;
  bool known_ = false;
  bool heard_ = true;
  LoopTimer timer_;
  OperationSlot waiting_;
  std::shared_ptr<Asked> asked_;  // the open question, or null
};

}  // namespace r4
