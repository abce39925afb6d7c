// SPDX-License-Identifier: GPL-3.0-or-later
// r4::async_discover(): discover() for programs with an Asio loop. With r4link::asio only.
//     r4::async_discover(io.get_executor(), {},
//                        [](std::exception_ptr error, r4::Discovery found) { … });
//     const auto found = co_await r4::async_discover(io.get_executor(), {}, asio::use_awaitable);
#pragma once

#include <asio/associated_executor.hpp>
#include <asio/async_result.hpp>
#include <asio/dispatch.hpp>
#include <asio/execution_context.hpp>
#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <asio/thread_pool.hpp>
#include <exception>
#include <optional>
#include <utility>

#include "discover.hpp"

namespace r4 {

// The thread for the searches of one io_context, because a search blocks. The io_context joins the
// thread, and destroys the handlers of searches that have not begun.
class DiscoveryThread final : public asio::execution_context::service {
 public:
  inline static asio::execution_context::id id;

  explicit DiscoveryThread(asio::execution_context& context) : service(context) {}
  asio::thread_pool& pool() { return *pool_; }

 private:
  void shutdown() override { pool_.reset(); }

  std::optional<asio::thread_pool> pool_{std::in_place, 1};
};

// void(std::exception_ptr, Discovery). Searches as discover() does, on a separate thread, one
// search at a time for each io_context. The handler runs on its associated executor, else on
// `executor`, and receives errors of discover(). A search cannot be cancelled, so the destructor of
// the io_context waits for the search, 1.3 s at most.
template <class Token>
auto async_discover(const asio::io_context::executor_type& executor, DiscoveryOptions options,
                    Token&& token) {
  auto start = [executor](auto handler, DiscoveryOptions where) {
    auto work = asio::make_work_guard(asio::get_associated_executor(handler, executor));
    auto search = [handler = std::move(handler), work = std::move(work),
                   where = std::move(where)]() mutable {
      std::exception_ptr error;
      Discovery found;
      try {
        found = discover(where);
      } catch (...) {
        error = std::current_exception();
      }
      asio::dispatch(work.get_executor(),
                     [handler = std::move(handler), error, found = std::move(found)]() mutable {
                       std::move(handler)(error, std::move(found));
                     });
    };
    asio::post(asio::use_service<DiscoveryThread>(executor.context()).pool(), std::move(search));
  };
  return asio::async_initiate<Token, void(std::exception_ptr, Discovery)>(std::move(start), token,
                                                                          std::move(options));
}

}  // namespace r4
