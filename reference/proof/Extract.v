(** The program as OCaml. These directives are trusted: that the functions of Coq on the left are those of OCaml on the right, for
    integers of 63 bits. [add], [sub] and [mul] wrap in both languages. What must not be extracted, because it is exact in Coq,
    is an assertion that fails. *)
From Proof Require Import Statement Checker Check.
From Coq Require Import Extraction ExtrOcamlBasic ZArith Bool.
Extract Inductive positive => int
  [ "(fun p -> 1 + 2 * p)" "(fun p -> 2 * p)" "1" ]
  "(fun f2p1 f2p f1 p -> if p <= 1 then f1 () else if p land 1 = 0 then f2p (p / 2) else f2p1 (p / 2))".
Extract Inductive Z => int [ "0" "" "(~-)" ] "(fun f0 fp fn z -> if z = 0 then f0 () else if z > 0 then fp z else fn (-z))".
Extract Inlined Constant wrap => "(assert false)".
Extract Inlined Constant Z.add => "(assert false)".
Extract Inlined Constant Z.sub => "(assert false)".
Extract Inlined Constant Z.mul => "(assert false)".
Extract Inlined Constant Z.modulo => "(assert false)".
Extract Inlined Constant add => "(+)".
Extract Inlined Constant sub => "(-)".
Extract Inlined Constant mul => "( * )".
Extract Inlined Constant Z.max => "(fun (a : int) (b : int) -> if a < b then b else a)".
Extract Inlined Constant Z.min => "(fun (a : int) (b : int) -> if a < b then a else b)".
Extract Inlined Constant Z.ltb => "(fun (a : int) (b : int) -> a < b)".
Extract Inlined Constant Z.leb => "(fun (a : int) (b : int) -> a <= b)".
Extract Inlined Constant Z.eqb => "(fun (a : int) (b : int) -> a = b)".
Extract Inlined Constant Z.shiftr => "(asr)".
Extract Inlined Constant Z.land => "(land)".
Extract Inlined Constant andb => "(&&)".
Extract Inlined Constant orb => "(||)".
Extract Inlined Constant negb => "not".
(* Loops of their own, without calls of closures. *)
Extraction Inline walk marked_skip extra_skip reaches count_child count_cube.
Extract Constant both => "Both.both".
Extraction "checker.ml" check.
