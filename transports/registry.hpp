// SPDX-License-Identifier: GPL-3.0-or-later
// Makes the carrier of a URL, from one table of schemes for all programs.
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

// `claim`: how to open a device that only one program can have open. Read at each opening.
using CarrierFactory = std::function<std::unique_ptr<Carrier>(asio::io_context& io, const Url& url,
                                                              Role role, Claim claim)>;

class Registry {
 public:
  struct Entry : TransportHelp {
    CarrierFactory make;
    // The transport's name for sharing. Null: not shared. Throws Error if there is no transport.
    std::function<ShareName(const Url& url)> share_name = nullptr;
    // True if no other program can use the transport of this URL, so it is not shared. Null: never.
    std::function<bool(const Url& url)> own = nullptr;
  };

  static Registry standard();

  void add(Entry entry);
  const std::vector<Entry>& entries() const { return entries_; }

  // The carrier of a URL, not yet opened and not shared: a host's `share` option is ignored. Throws
  // Error{usage} for an unknown scheme, or a URL that the scheme does not accept.
  std::unique_ptr<Carrier> make(asio::io_context& io, std::string_view url, Role role) const;
  std::unique_ptr<Carrier> make_shared(asio::io_context& io, std::string_view url,
                                       BoardRole role) const;

 private:
  const Entry& entry_of(const Url& url) const;

  std::vector<Entry> entries_;
};

}  // namespace r4
