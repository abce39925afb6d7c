// SPDX-License-Identifier: GPL-3.0-or-later
// From a URL to a carrier: one table of schemes serves the library, the simulated board and `r4`.
#pragma once

#include <asio/io_context.hpp>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "r4link/carrier.hpp"
#include "r4link/options.hpp"
#include "share_name.hpp"
#include "url.hpp"

namespace r4 {

using CarrierFactory =
    std::function<std::unique_ptr<Carrier>(asio::io_context& io, const Url& url, Role role)>;

class Registry {
 public:
  struct Entry {
    std::string scheme;
    std::string usage;    // "udp://HOST[:2018][?listen=2390&local=ADDRESS]"
    std::string meaning;  // one line for --help
    CarrierFactory make;
    // What the transport of a URL is called among the programs that share it (share_name.hpp).
    // None: programs do not share it. Throws Error if the transport cannot be found.
    std::function<ShareName(const Url& url)> share_name = nullptr;
    // True if the transport of this URL is its program's own, which is not shared. None: it never
    // is.
    std::function<bool(const Url& url)> own = nullptr;
    // The host's carrier of what one program can have at a time.
    std::function<std::unique_ptr<Carrier>(asio::io_context& io, const Url& url,
                                           std::shared_ptr<DeviceClaim> claim)>
        make_claimed = nullptr;
  };

  // A registry with the transports of this folder: udp, serial, pty, can.
  static Registry standard();

  void add(Entry entry);
  const std::vector<Entry>& entries() const { return entries_; }

  // The carrier for a URL, not yet opened. Throws Error{usage} for an unknown scheme, naming those
  // that exist, and for a URL that its scheme does not take. A host's is of its own: `share` is passed over.
  std::unique_ptr<Carrier> make(asio::io_context& io, std::string_view url, Role role) const;
  // The same for a host's program, which shares the transport with others of this computer.
  std::unique_ptr<Carrier> make_shared(asio::io_context& io, std::string_view url,
                                       BoardRole role) const;

 private:
  const Entry& entry_of(const Url& url) const;

  std::vector<Entry> entries_;
};

}  // namespace r4
