// SPDX-License-Identifier: GPL-3.0-or-later
// A transport with a bad link in both directions. On CAN the impairment affects whole datagrams.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "impairment.hpp"
#include "r4link/carrier.hpp"

namespace r4 {

class ImpairedCarrier : public Carrier {
 public:
  // Counts since the last open().
  virtual const ImpairmentCounters& received() const = 0;
  virtual const ImpairmentCounters& sent() const = 0;
};

std::unique_ptr<ImpairedCarrier> make_impaired_carrier(asio::io_context& io,
                                                       std::unique_ptr<Carrier> below,
                                                       const Impairment& impairment);

}  // namespace r4
