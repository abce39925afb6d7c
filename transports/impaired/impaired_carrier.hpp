// SPDX-License-Identifier: GPL-3.0-or-later
// A transport with a bad link before it: datagrams of both directions are lost, delayed, doubled, damaged and cut
// off, as Impairment says. At either end, and for any transport; of a transfer in frames (CAN) it is the datagram
// that suffers.
#pragma once

#include <asio/io_context.hpp>
#include <memory>

#include "impairment.hpp"
#include "r4link/carrier.hpp"

namespace r4 {

class ImpairedCarrier : public Carrier {
 public:
  // What came in, and what went out, since it was opened last.
  virtual const ImpairmentCounters& received() const = 0;
  virtual const ImpairmentCounters& sent() const = 0;
};

std::unique_ptr<ImpairedCarrier> make_impaired_carrier(asio::io_context& io,
                                                       std::unique_ptr<Carrier> below,
                                                       const Impairment& impairment);

}  // namespace r4
