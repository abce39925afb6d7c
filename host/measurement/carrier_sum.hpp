// SPDX-License-Identifier: GPL-3.0-or-later
// What several transports have carried together.
#pragma once

#include "r4link/carrier.hpp"

namespace r4 {

inline void add(TransferCounters& sum, const TransferCounters& more) {
  sum.wrong_sequence += more.wrong_sequence;
  sum.timed_out += more.timed_out;
  sum.overflow += more.overflow;
  sum.interrupted += more.interrupted;
  sum.cancelled += more.cancelled;
  sum.unexpected += more.unexpected;
  sum.malformed += more.malformed;
  sum.packed += more.packed;
  sum.bad_form += more.bad_form;
}

inline void add(CarrierCounters& sum, const CarrierCounters& more) {
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
  if (!more.transfers) return;
  if (!sum.transfers) sum.transfers.emplace();
  add(*sum.transfers, *more.transfers);
}

}  // namespace r4
