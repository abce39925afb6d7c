// SPDX-License-Identifier: GPL-3.0-or-later
// Any text for a link: it is refused with a reason, is a valid URL, or is a bad link within its
// bounds. A bad link loses and delays datagrams as its text states, and adds no datagram.
#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "input.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/error.hpp"
#include "transports/impaired/impairment.hpp"

namespace r4 {
namespace {

template <class Parse>
void try_it(Parse parse) {
  try {
    parse();
  } catch (const Error& error) {
    const Problem& problem = error.problem();
    require(problem.kind == ErrorKind::usage && !problem.reason.empty() && !problem.fix.empty());
  }
}

void read_url(std::string_view text) {
  const Url url = Url::parse(text);
  require(url.text() == text && !url.scheme().empty());
  static_cast<void>(url.get_number("node", 0, 31, 0));
}

void read_impairment(std::string_view text) {
  const Impairment link = Impairment::parse(text);
  for (const double share : {link.loss, link.duplicate, link.corrupt}) {
    require(share >= 0 && share <= 1);
  }
  constexpr Time longest = std::chrono::hours(1);
  for (const Time time : {link.delay, link.jitter, link.cut_at, link.cut_for}) {
    require(time >= Time(0) && time <= longest);
  }
  ImpairedDirection direction(link, 1, Time(0));
  constexpr int datagrams = 50;
  Time now(0);
  for (int i = 0; i < datagrams; ++i) {
    direction.put(now, {"datagram", 0, 0});
    now += std::chrono::milliseconds(10);
  }
  std::uint64_t came = 0;
  for (Time last(0); direction.due(); ++came) {
    require(*direction.due() >= last && *direction.due() <= now + 2 * longest);
    last = *direction.due();
    require(direction.take(last)->bytes.size() == std::string_view("datagram").size());
  }
  const ImpairmentCounters& counted = direction.counters();
  require(came == counted.passed && counted.overflow == 0);
  require(came + counted.lost + counted.cut == datagrams + counted.duplicated);
}

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  r4::try_it([text] { r4::read_url(text); });
  r4::try_it([text] { r4::read_impairment(text); });
  return 0;
}
