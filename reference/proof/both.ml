(* Whether a () and b (), each evaluated in a process of its own. Trusted: the answer is true only if both are, and false only if one is: a
   process that is killed, or raises an exception, has none. *)
let both a b =
  match Unix.fork () with
  | exception Unix.Unix_error _ -> a () && b ()
  | 0 -> Unix._exit (match a () with true -> 0 | false -> 1 | exception _ -> 2)
  | child ->
    let rec ended () = match Unix.waitpid [] child with
      | exception Unix.Unix_error (Unix.EINTR, _, _) -> ended ()
      | _, status -> status in
    let right = b () in
    match ended () with
    | Unix.WEXITED 0 -> right
    | Unix.WEXITED 1 -> false
    | _ -> failwith "a process of the checker was killed or raised an exception: free memory"
