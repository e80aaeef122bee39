(* The crossing leaves that were deleted after gradation. They are not in any file, and the theorem holds for whatever is offered in their
   place, so nothing here is trusted: a wrong offer makes the checker reject.

   Gradation can split a crossing leaf of T0 only where a box finer than the surface is near. *)

type words = (int64, Bigarray.int64_elt, Bigarray.c_layout) Bigarray.Array1.t

(* A leaf without its side, key * 2^5 + level, fits into an integer. *)
type leaves = { count : int; get : int -> int }
let level v = v land 31
let key v = v lsr 5
let of_words (a : words) = { count = Bigarray.Array1.dim a; get = (fun i -> Int64.to_int (Int64.shift_right_logical a.{i} 2)) }
let of_array a = { count = Array.length a; get = Array.get a }
let to_words a : words =
  Bigarray.Array1.of_array Bigarray.int64 Bigarray.c_layout
    (Array.map (fun v -> Int64.logor (Int64.shift_left (Int64.of_int v) 2) 2L) a)

let corner v =
  let axis a =
    let x = ref 0 in
    for bit = 0 to 18 do if (key v) lsr (3 * bit + a) land 1 = 1 then x := !x lor (1 lsl bit) done;
    !x in
  [| axis 0; axis 1; axis 2 |]

(* The first leaf whose key is not before k. *)
let first s k =
  let rec search lo hi = if lo >= hi then lo else let i = (lo + hi) / 2 in if key (s.get i) < k then search (i + 1) hi else search lo i in
  search 0 s.count

(* Whether a leaf that is wanted is closer than [reach] to an octant; touching ones are closer than 1. Leaves that are coarser than
   [wanted_level] are not wanted. *)
let near sets v reach wanted_level wanted =
  let c = corner v and e = 1 lsl (19 - level v) in
  let rec any s k l x y z =
    let f = 1 lsl (19 - l) in
    let near p q = q + f > p - reach && q < p + e + reach in
    near c.(0) x && near c.(1) y && near c.(2) z &&
    let i = first s k in
    i < s.count && key (s.get i) < k + (1 lsl (3 * (19 - l))) &&
    if s.get i = k lsl 5 lor l then l >= wanted_level && wanted (s.get i)
    else l < 19 && List.exists (fun j -> any s (k + j lsl (3 * (18 - l))) (l + 1)
      (x + (j land 1) * f / 2) (y + (j lsr 1 land 1) * f / 2) (z + (j lsr 2) * f / 2)) [0; 1; 2; 3; 4; 5; 6; 7] in
  List.exists (fun s -> any s 0 0 0 0 0) sets

let children v = List.init 8 (fun j -> (key v + j lsl (3 * (18 - level v))) lsl 5 lor (level v + 1))
let parent v = let l = level v - 1 in ((key v lsr (3 * (19 - l))) lsl (3 * (19 - l) + 5)) lor l

(* The crossing leaves of T0, split as gradation splits them: for each level that is finer than the surface, the layer around sources, and
   balance. *)
let refined surface n (base : words list) (mesh : words list) (crossing : words list) : words list =
  let base = List.map of_words base and mesh = List.map of_words mesh in
  let rec refine needs a =
    if List.exists needs a then refine needs (List.concat_map (fun v -> if needs v then children v else [v]) a) else a in
  let everyone _ = true in
  let step a l =
    let cells = 1 lsl (19 - l) in
    let all = of_array (Array.of_list a) :: mesh in
    let split_before q = near base q 0 l everyone || near all q 1 (l + 1) everyone in
    let source p = level p = l && split_before (parent p) in
    let a = refine (fun v -> level v < l && near all v ((n - 1) * cells) l source) a in
    let all = of_array (Array.of_list a) :: mesh in
    refine (fun v -> level v < l - 1 && near all v 1 l everyone) a in
  let all = List.concat_map (fun w -> let s = of_words w in List.init s.count s.get) crossing in
  [to_words (Array.of_list (List.fold_left step (List.sort compare all) (List.init (19 - surface) (fun i -> 19 - i))))]
