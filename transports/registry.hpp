// SPDX-License-Identifier: GPL-3.0-or-later
// Makes the carrier of a URL: one table of schemes serves the library, the simulated board and
// `r4`.
#pragma once

#include <asio/io_context.hpp>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "r4link/carrier.hpp"
#include "r4link/discovery/transports.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/options.hpp"
#include "share_name.hpp"

namespace r4 {

// `claim`: how a transport opens a device that one program can have at a time. It is read at each
// opening.
using CarrierFactory = std::function<std::unique_ptr<Carrier>(asio::io_context& io, const Url& url,
                                                              Role role, Claim claim)>;

class Registry {
 public:
  struct Entry : TransportHelp {
    CarrierFactory make;
    // The name under which programs share the transport of a URL. Null: programs do not share it.
    // Throws Error if the transport cannot be found.
    std::function<ShareName(const Url& url)> share_name = nullptr;
    // True if the transport of this URL belongs to its program alone. Null: never.
    std::function<bool(const Url& url)> own = nullptr;
  };

  // A registry with the transports of this folder: udp, serial, pty, can.
  static Registry standard();

  void add(Entry entry);
  const std::vector<Entry>& entries() const { return entries_; }

  // The carrier for a URL, not yet opened. Throws Error{usage} for an unknown scheme, with the
  // schemes that exist, and for a URL that its scheme does not take. A host does not share the
  // transport: `share` is ignored.
  std::unique_ptr<Carrier> make(asio::io_context& io, std::string_view url, Role role) const;
  // The carrier of a host that shares the transport with other programs of this computer.
  std::unique_ptr<Carrier> make_shared(asio::io_context& io, std::string_view url,
                                       BoardRole role) const;

 private:
  const Entry& entry_of(const Url& url) const;

  std::vector<Entry> entries_;
};

}  // namespace r4
