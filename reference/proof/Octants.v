(** Trees as lists of leaves and as functions of unit cells: what the walks of the program are proven about; and what their nodes keep. *)
From Coq Require Import ZArith List Bool Lia Permutation.
Import ListNotations.
From Proof Require Import Statement Checker.
Open Scope Z_scope.

(** * Trees *)

(** Edge of an octant of height h, which has level 19 - h. *)
Definition E (h : nat) : Z := 2 ^ Z.of_nat h.
Lemma E_S h : E (S h) = 2 * E h.
Proof. unfold E. rewrite Nat2Z.inj_succ, Z.pow_succ_r; lia. Qed.
Lemma E_pos h : 0 < E h.
Proof. apply Z.pow_pos_nonneg; lia. Qed.
Lemma half h : Z.shiftr (E (S h)) 1 = E h.
Proof. rewrite Z.shiftr_div_pow2 by lia. change (2 ^ 1) with 2. rewrite E_S. symmetry. apply Z.div_unique with 0; lia. Qed.
Lemma E_cells h : cells (19 - Z.of_nat h) = E h.
Proof. unfold cells, E. f_equal. lia. Qed.
Lemma E_root : E 19 = 524288. Proof. reflexivity. Qed.
Lemma E_le h : (h <= 19)%nat -> E h <= 524288.
Proof. intros. rewrite <- E_root. unfold E. apply Z.pow_le_mono_r; lia. Qed.
#[global] Opaque E.

Definition off (b : bool) (n : nat) : Z := if b then E n else 0.
Definition inner (t : tree) : Prop := match t with Node _ _ _ _ _ _ _ _ _ _ _ => True | _ => False end.
Definition corners : list (bool * bool * bool) :=
  [(false, false, false); (true, false, false); (false, true, false); (true, true, false);
   (false, false, true); (true, false, true); (false, true, true); (true, true, true)].
Lemma all_corners i j k : In (i, j, k) corners.
Proof. destruct i, j, k; simpl; tauto. Qed.
Lemma corners_differ : ForallOrdPairs (fun p q => p <> q) corners.
Proof. unfold corners. repeat (constructor; [repeat (constructor; try discriminate)|]). constructor. Qed.

(** A tree of at most h levels below its root. *)
Fixpoint deep (h : nat) (t : tree) : Prop :=
  match t with
  | Cube _ => True
  | Node _ _ _ a b c d e f g i =>
    match h with
    | O => False
    | S n => deep n a /\ deep n b /\ deep n c /\ deep n d /\ deep n e /\ deep n f /\ deep n g /\ deep n i
    end
  end.
Lemma deep_kid n t : inner t -> (deep (S n) t <-> forall i j k, deep n (kid i j k t)).
Proof.
  destruct t; [contradiction|]. intros _. cbn [deep]. split.
  - intros H i j k. destruct i, j, k; cbn; tauto.
  - intros H. pose proof (H false false false). pose proof (H true false false). pose proof (H false true false).
    pose proof (H true true false). pose proof (H false false true). pose proof (H true false true).
    pose proof (H false true true). pose proof (H true true true). cbn in *. tauto.
Qed.
Lemma deep_O t : inner t -> deep 0 t -> False.
Proof. destruct t; simpl; tauto. Qed.
Lemma deep_Kid h t i j k : deep (S h) t -> deep h (kid i j k t).
Proof. intros D. destruct t as [q|]; [destruct h; exact I|]. revert i j k. apply deep_kid; [exact I | exact D]. Qed.

Lemma tree_induction (P : nat -> tree -> Prop) :
  (forall h k, P h (Cube k)) ->
  (forall n t, inner t -> deep (S n) t -> (forall i j k, P n (kid i j k t)) -> P (S n) t) ->
  forall h t, deep h t -> P h t.
Proof.
  intros A B. induction h as [| h IH]; intros t D.
  - destruct t; [apply A | destruct D].
  - destruct t as [k | p q r a b c d e f g i]; [apply A|]. apply B; [exact I | exact D|].
    intros x y z. apply IH. apply deep_kid; [exact I | exact D].
Qed.

Ltac by_tree :=
  let h := fresh "h" in let t := fresh "t" in let D := fresh "D" in
  intros h t D; pattern h, t; match goal with |- ?P h t => refine (tree_induction P _ _ h t D); clear h t D end; cbv beta.

(** The kind of a tree with corner (x, y, z) at a unit cell. *)
Fixpoint look (h : nat) (x y z u v w : Z) (t : tree) : kind :=
  match t with
  | Cube k => k
  | Node _ _ _ a b c d e f g i =>
    match h with
    | O => Empty
    | S n =>
      let X := x + E n in let Y := y + E n in let Z := z + E n in
      if w <? Z then
        if v <? Y then if u <? X then look n x y z u v w a else look n X y z u v w b
        else if u <? X then look n x Y z u v w c else look n X Y z u v w d
      else
        if v <? Y then if u <? X then look n x y Z u v w e else look n X y Z u v w f
        else if u <? X then look n x Y Z u v w g else look n X Y Z u v w i
    end
  end.
Lemma look_cube h x y z u v w k : look h x y z u v w (Cube k) = k.
Proof. destruct h; reflexivity. Qed.
Lemma look_kid n x y z u v w t : exists i j k,
  look (S n) x y z u v w t = look n (x + off i n) (y + off j n) (z + off k n) u v w (kid i j k t) /\
  (if i then x + E n <= u else u < x + E n) /\ (if j then y + E n <= v else v < y + E n) /\
  (if k then z + E n <= w else w < z + E n).
Proof.
  exists (x + E n <=? u), (y + E n <=? v), (z + E n <=? w).
  destruct (Z.leb_spec (x + E n) u), (Z.leb_spec (y + E n) v), (Z.leb_spec (z + E n) w);
  (split; [|auto]); (destruct t as [| p q r a b c d e f g i]; [cbn [kid]; rewrite !look_cube; reflexivity|]); cbn [look]; cbv zeta;
  destruct (Z.ltb_spec w (z + E n)); try lia; destruct (Z.ltb_spec v (y + E n)); try lia; destruct (Z.ltb_spec u (x + E n)); try lia;
  cbn [kid off]; rewrite ?Z.add_0_r; reflexivity.
Qed.
(** The child is determined by the position. *)
Lemma look_at n x y z u v w t (i j k : bool) :
  (if i then x + E n <= u else u < x + E n) -> (if j then y + E n <= v else v < y + E n) -> (if k then z + E n <= w else w < z + E n) ->
  look (S n) x y z u v w t = look n (x + off i n) (y + off j n) (z + off k n) u v w (kid i j k t).
Proof.
  intros A B C. destruct (look_kid n x y z u v w t) as (i' & j' & k' & L & A' & B' & C').
  replace i with i' by (destruct i, i'; trivial; lia). replace j with j' by (destruct j, j'; trivial; lia).
  replace k with k' by (destruct k, k'; trivial; lia). exact L.
Qed.

Section Sides.
Variable s0 : side.  (** of [Reached] leaves *)
Definition side_in (k : kind) : option side :=
  match k with Empty => None | Outer => Some Outside | Inner => Some Inside | Cross => Some Crossing | Reached => Some s0 end.

Fixpoint flat (h : nat) (x y z : Z) (t : tree) : list leaf :=
  match t with
  | Cube k => match side_in k with None => [] | Some s => [Leaf x y z (19 - Z.of_nat h) s] end
  | Node _ _ _ a b c d e f g i =>
    match h with
    | O => []
    | S n =>
      let X := x + E n in let Y := y + E n in let Z := z + E n in
      flat n x y z a ++ flat n X y z b ++ flat n x Y z c ++ flat n X Y z d ++
      flat n x y Z e ++ flat n X y Z f ++ flat n x Y Z g ++ flat n X Y Z i
    end
  end.
Lemma flat_cube h x y z k o : In o (flat h x y z (Cube k)) <-> exists s, side_in k = Some s /\ o = Leaf x y z (19 - Z.of_nat h) s.
Proof.
  destruct h; cbn [flat]; (destruct (side_in k) as [s|]; split; [intros [<-|[]]; eauto | intros (? & H & ->); injection H as <-; left; reflexivity
    | intros [] | intros (? & H & _); discriminate]).
Qed.
Definition flat_kid n x y z t '(i, j, k) := flat n (x + off i n) (y + off j n) (z + off k n) (kid i j k t).
Lemma flat_kids n x y z t : inner t -> flat (S n) x y z t = flat_map (flat_kid n x y z t) corners.
Proof.
  destruct t as [| p q r a b c d e f g i]; [contradiction|]. intros _. cbn [flat corners flat_map flat_kid kid off].
  rewrite ?Z.add_0_r, app_nil_r. reflexivity.
Qed.
Lemma in_flat n x y z t o : inner t -> (In o (flat (S n) x y z t) <->
  exists i j k, In o (flat n (x + off i n) (y + off j n) (z + off k n) (kid i j k t))).
Proof.
  intros T. rewrite flat_kids, in_flat_map by exact T. split.
  - intros ([[i j] k] & _ & H). exists i, j, k. exact H.
  - intros (i & j & k & H). exists (i, j, k). split; [apply all_corners | exact H].
Qed.

Lemma flat_inside : forall h t, deep h t -> forall x y z o, In o (flat h x y z t) ->
  (x <= cx o /\ cx o + edge o <= x + E h) /\ (y <= cy o /\ cy o + edge o <= y + E h) /\ (z <= cz o /\ cz o + edge o <= z + E h) /\
  0 < edge o /\ 19 - Z.of_nat h <= level o <= 19.
Proof.
  by_tree.
  - intros h k x y z o H. apply flat_cube in H. destruct H as (s & _ & ->).
    unfold edge. cbn [level cx cy cz]. rewrite E_cells. pose proof (E_pos h). lia.
  - intros n t T _ IH x y z o H. apply (in_flat n x y z t o T) in H. destruct H as (i & j & k & H).
    apply IH in H. rewrite E_S. unfold off in H. pose proof (E_pos n). destruct i, j, k; lia.
Qed.

Lemma flat_aligned : forall h t, deep h t -> forall x y z o, (E h | x) -> (E h | y) -> (E h | z) -> In o (flat h x y z t) ->
  (edge o | cx o) /\ (edge o | cy o) /\ (edge o | cz o).
Proof.
  by_tree.
  - intros h k x y z o A B C H. apply flat_cube in H. destruct H as (s & _ & ->).
    unfold edge. cbn [level cx cy cz]. rewrite E_cells. auto.
  - intros n t T _ IH x y z o A B C H. apply (in_flat n x y z t o T) in H. destruct H as (i & j & k & H).
    assert (forall q b, (E (S n) | q) -> (E n | q + off b n)) as D.
    { intros q b [m Q]. rewrite E_S in Q. subst q. apply Z.divide_add_r; [exists (m * 2); ring|].
      destruct b; [apply Z.divide_refl | apply Z.divide_0_r]. }
    apply IH in H; auto.
Qed.

Lemma flat_look : forall h t, deep h t -> forall x y z o, In o (flat h x y z t) ->
  exists k, side_in k = Some (side_of o) /\ forall u v w, holds o u v w -> look h x y z u v w t = k.
Proof.
  by_tree.
  - intros h k x y z o H. exists k. split; [|intros; apply look_cube].
    apply flat_cube in H. destruct H as (s & K & ->). exact K.
  - intros n t T D IH x y z o H. apply (in_flat n x y z t o T) in H. destruct H as (i & j & k & H).
    destruct (IH _ _ _ _ _ _ _ H) as (q & S & L). exists q. split; [exact S|]. intros u v w O.
    rewrite <- (L u v w O). pose proof (proj1 (deep_kid n t T) D i j k) as DK.
    pose proof (flat_inside n _ DK _ _ _ _ H) as B. unfold holds in O. unfold off in B.
    apply look_at; [destruct i | destruct j | destruct k]; lia.
Qed.

Lemma look_flat : forall h t, deep h t -> forall x y z u v w s,
  x <= u < x + E h -> y <= v < y + E h -> z <= w < z + E h -> side_in (look h x y z u v w t) = Some s ->
  exists o, In o (flat h x y z t) /\ holds o u v w /\ side_of o = s.
Proof.
  by_tree.
  - intros h k x y z u v w s A B C L. rewrite look_cube in L. exists (Leaf x y z (19 - Z.of_nat h) s).
    split; [|split; [|reflexivity]].
    + destruct h; cbn [flat]; rewrite L; left; reflexivity.
    + unfold holds, edge. cbn [level cx cy cz]. rewrite E_cells. auto.
  - intros n t T _ IH x y z u v w s A B C L. rewrite E_S in *.
    destruct (look_kid n x y z u v w t) as (i & j & k & K & P & Q & R). rewrite K in L.
    apply IH in L; [| destruct i; cbn [off]; lia | destruct j; cbn [off]; lia | destruct k; cbn [off]; lia].
    destruct L as (o & O & HS). exists o. split; [apply in_flat; [exact T | exists i, j, k; exact O] | exact HS].
Qed.

Lemma pairs_app {A} (R : A -> A -> Prop) l m : ForallOrdPairs R l -> ForallOrdPairs R m ->
  (forall a b, In a l -> In b m -> R a b) -> ForallOrdPairs R (l ++ m).
Proof.
  induction 1 as [| a l F _ IH]; intros M C; [exact M|]. simpl. constructor.
  - apply Forall_app. split; [exact F|]. apply Forall_forall. intros b B. apply C; [left; reflexivity | exact B].
  - apply IH; [exact M|]. intros b c B D. apply C; [right; exact B | exact D].
Qed.
Lemma pairs_flat_map {A B} (R : B -> B -> Prop) (f : A -> list B) l : (forall a, ForallOrdPairs R (f a)) ->
  ForallOrdPairs (fun a b => forall p q, In p (f a) -> In q (f b) -> R p q) l -> ForallOrdPairs R (flat_map f l).
Proof.
  intros F. induction 1 as [| a l P _ IH]; [constructor|]. simpl. apply pairs_app; [apply F | exact IH|].
  intros p q H K. apply in_flat_map in K. destruct K as (b & B' & Q).
  rewrite Forall_forall in P. exact (P b B' p q H Q).
Qed.
Lemma pairs_weaken {A} (R S : A -> A -> Prop) l : (forall a b, R a b -> S a b) -> ForallOrdPairs R l -> ForallOrdPairs S l.
Proof. intros W. induction 1; constructor; [eapply Forall_impl; [|eassumption]; auto | assumption]. Qed.

Lemma flat_disjoint : forall h t, deep h t -> forall x y z, ForallOrdPairs disjoint (flat h x y z t).
Proof.
  by_tree.
  - intros h k x y z. destruct h; cbn [flat]; destruct (side_in k); repeat constructor.
  - intros n t T D IH x y z. rewrite flat_kids by exact T. apply pairs_flat_map.
    + intros [[i j] k]. apply IH.
    + apply (pairs_weaken _ _ _) with (2 := corners_differ). intros [[i j] k] [[i' j'] k'] N p q P Q u v w HP HQ.
      pose proof (proj1 (deep_kid n t T) D) as DK.
      apply (flat_inside n _ (DK i j k)) in P. apply (flat_inside n _ (DK i' j' k')) in Q.
      unfold off in *. unfold holds in *. apply N. pose proof (E_pos n).
      assert (i = i') by (destruct i, i'; trivial; lia). assert (j = j') by (destruct j, j'; trivial; lia).
      assert (k = k') by (destruct k, k'; trivial; lia). congruence.
Qed.
End Sides.

(** Disjointness does not depend on the order. *)
Lemma disjoint_sym a b : disjoint a b -> disjoint b a.
Proof. unfold disjoint. intros H u v w A B. exact (H u v w B A). Qed.
Lemma pairs_permutation {A} (R : A -> A -> Prop) : (forall a b, R a b -> R b a) ->
  forall l m, Permutation l m -> ForallOrdPairs R l -> ForallOrdPairs R m.
Proof.
  intros S l m P. induction P as [| a l m P IH | a b l | l m n _ IH1 _ IH2]; intros H; auto.
  - inversion H as [| ? ? F G]; subst. constructor; [|auto]. apply Forall_forall. intros b B.
    rewrite Forall_forall in F. apply F. apply (Permutation_in b (Permutation_sym P)). exact B.
  - inversion H as [| ? ? F G]; subst. inversion F as [| ? ? F1 F2]; subst. inversion G as [| ? ? G1 G2]; subst.
    constructor; [constructor; auto|]. constructor; auto.
Qed.
Lemma in_pairs a b l : ForallOrdPairs disjoint l -> In a l -> In b l -> forall u v w, holds a u v w -> holds b u v w -> a = b.
Proof.
  intros F A B u v w P Q. destruct (ForallOrdPairs_In F a b A B) as [E' | [D | D]]; [exact E' | |].
  - destruct (D u v w P Q).
  - destruct (D u v w Q P).
Qed.

(** * What the nodes of a tree keep: bounds of the edges of their leaves, and whether they have a leaf of a kind *)

(** Arithmetic that does not wrap. *)
Definition small (a : Z) : Prop := -4611686018427387904 <= a < 4611686018427387904.
Lemma wrap_small a : small a -> wrap a = a.
Proof. unfold wrap, small. intros. rewrite Z.mod_small; lia. Qed.
Lemma add_small a b : small (a + b) -> add a b = a + b. Proof. apply wrap_small. Qed.
Lemma sub_small a b : small (a - b) -> sub a b = a - b. Proof. apply wrap_small. Qed.
Lemma mul_small a b : small (a * b) -> mul a b = a * b. Proof. apply wrap_small. Qed.

(** Sharing changes nothing. *)
Lemma same_brood_right t u : same_brood t u = true -> t = u.
Proof.
  assert (forall a b, same a b = true -> a = b) as S by (intros [] []; trivial; discriminate).
  unfold same_brood. intros H. repeat match type of H with match ?x with _ => _ end = _ => destruct x; try discriminate end.
  repeat match goal with H : _ && _ = true |- _ => apply andb_prop in H; destruct H end.
  repeat match goal with H : same _ _ = true |- _ => apply S in H end.
  repeat match goal with H : (_ =? _) = true |- _ => apply Z.eqb_eq in H end. subst.
  match goal with H : (if ?r then ?r' else negb ?r') = true |- _ => destruct r, r'; try discriminate end; reflexivity.
Qed.
Lemma share_right t : share t = t.
Proof.
  assert (forall s m r k, share_with s t m r k = t) as S.
  { induction s as [| [z o o' i i' x x'] s IH]; intros m r k; cbn [share_with]; [reflexivity|]. destruct (z =? m); [|apply IH].
    cbv zeta. destruct (same_brood _ t) eqn:E; [|reflexivity]. apply same_brood_right in E. exact E. }
  unfold share. repeat match goal with |- match ?x with _ => _ end = _ => destruct x; trivial end; apply S.
Qed.
Lemma twig_right z b k : twig z b k = brood z b k.
Proof.
  assert (Forall (fun '(Broods z o o' i i' x x') => o = brood z false Outer /\ o' = brood z true Outer /\ i = brood z false Inner /\ i' = brood z true Inner /\
    x = brood z false Cross /\ x' = brood z true Cross) all_broods) as A by (repeat constructor).
  unfold twig. induction A as [| [z' o o' i i' x x'] s (-> & -> & -> & -> & -> & ->) _ IH]; cbn [twig_of]; [reflexivity|].
  destruct (Z.eqb_spec z' z) as [->|]; [|exact IH]. destruct k, b; reflexivity.
Qed.
Lemma join_twig k0 z k : k <> Empty -> let c := Cube k in join k0 z c c c c c c c c = brood z (same k0 k) k.
Proof.
  intros N c. unfold join, brood, max8, min8, c. destruct k; [congruence|..]; cbn [most least has]; rewrite !Z.max_id, !Z.min_id, !orb_diag; reflexivity.
Qed.
#[global] Opaque share twig.

Section Sizes.
Variable k0 : kind.

Inductive sized : nat -> tree -> Prop :=
  | sized_cube h k : sized h (Cube k)
  | sized_node n t : inner t -> 0 <= most t 0 <= 524288 -> 0 <= least t 0 <= none ->
      (forall i j k, sized n (kid i j k t)) ->
      (forall i j k, most (kid i j k t) (E n) <= most t 0 /\ least t 0 <= least (kid i j k t) (E n) /\
                     (has k0 (kid i j k t) = true -> has k0 t = true)) ->
      sized (S n) t.

Lemma sized_deep : forall h t, sized h t -> deep h t.
Proof.
  intros h t S. induction S as [h k | n t T _ _ _ IH _].
  - destruct h; exact I.
  - apply deep_kid; [exact T | exact IH].
Qed.

Lemma sized_most h t : (h <= 19)%nat -> sized h t -> 0 <= most t (E h) <= 524288 /\ 0 <= least t (E h) <= none.
Proof.
  intros H S. pose proof (E_pos h). pose proof (E_le h H). unfold none. destruct S as [h k | n t T M L _ _].
  - destruct k; simpl; unfold none; lia.
  - destruct t; [destruct T|]. simpl in *. unfold none in L. lia.
Qed.

Lemma max8_le a b c d e f g h x : a <= x -> b <= x -> c <= x -> d <= x -> e <= x -> f <= x -> g <= x -> h <= x -> max8 a b c d e f g h <= x.
Proof. unfold max8. intros. repeat apply Z.max_lub; assumption. Qed.
Lemma min8_ge a b c d e f g h x : x <= a -> x <= b -> x <= c -> x <= d -> x <= e -> x <= f -> x <= g -> x <= h -> x <= min8 a b c d e f g h.
Proof. unfold min8. intros. repeat apply Z.min_glb; assumption. Qed.
Lemma min8_max8 a b c d e f g h x : x = a \/ x = b \/ x = c \/ x = d \/ x = e \/ x = f \/ x = g \/ x = h ->
  min8 a b c d e f g h <= x <= max8 a b c d e f g h.
Proof.
  unfold min8, max8. pose proof (Z.le_refl x). intros [->|[->|[->|[->|[->|[->|[->| ->]]]]]]];
  rewrite !Z.min_le_iff, !Z.max_le_iff; tauto.
Qed.

Lemma sized_join n a b c d e f g h : (n <= 18)%nat -> let t := join k0 (E n) a b c d e f g h in
  (forall i j k, sized n (kid i j k t)) -> sized (S n) t.
Proof.
  intros N t H.
  assert (forall i j k, least t 0 <= least (kid i j k t) (E n) /\ most (kid i j k t) (E n) <= most t 0) as B.
  { intros i j k. unfold t, join. cbn [most least].
    destruct i, j, k; cbn [kid]; (split; [|]); (eapply Z.le_trans; [|]; [apply min8_max8 | apply Z.le_refl]) || apply min8_max8; tauto. }
  assert (forall i j k, 0 <= most (kid i j k t) (E n) <= 524288 /\ 0 <= least (kid i j k t) (E n) <= none) as C
    by (intros i j k; apply sized_most; [lia | apply H]).
  constructor; [exact I | | | exact H |].
  - pose proof (B false false false). pose proof (C false false false). split; [lia|].
    unfold t at 1, join. cbn [most]. apply max8_le;
    [apply (C false false false) | apply (C true false false) | apply (C false true false) | apply (C true true false) |
     apply (C false false true) | apply (C true false true) | apply (C false true true) | apply (C true true true)].
  - pose proof (B false false false). pose proof (C false false false). split; [|lia].
    unfold t at 1, join. cbn [least]. apply min8_ge;
    [apply (C false false false) | apply (C true false false) | apply (C false true false) | apply (C true true false) |
     apply (C false false true) | apply (C true false true) | apply (C false true true) | apply (C true true true)].
  - intros i j k. split; [apply B | split; [apply B|]]. unfold t, join. cbn [has].
    destruct i, j, k; cbn [kid]; intros ->; rewrite ?orb_true_r; reflexivity.
Qed.

Lemma flat_size s0 : forall h t, sized h t -> forall x y z o, In o (flat s0 h x y z t) -> least t (E h) <= edge o <= most t (E h).
Proof.
  intros h t S. induction S as [h k | n t T _ _ _ IH B]; intros x y z o H.
  - apply flat_cube in H. destruct H as (s & K & ->). unfold edge. cbn [level]. rewrite E_cells.
    destruct k; cbn [most least]; [discriminate | lia ..].
  - apply in_flat in H; [|exact T]. destruct H as (i & j & k & H). apply IH in H. specialize (B i j k).
    destruct t; [destruct T|]. simpl in *. lia.
Qed.

(** A tree without the kind has no leaf of it. *)
Lemma flat_has s0 s : side_in s0 k0 = Some s -> (forall k, side_in s0 k = Some s -> k = k0) ->
  forall h t, sized h t -> has k0 t = false -> forall x y z o, In o (flat s0 h x y z t) -> side_of o <> s.
Proof.
  intros K U h t S. induction S as [h k | n t T _ _ _ IH B]; intros F x y z o H.
  - apply flat_cube in H. destruct H as (s' & Q & ->). cbn [side_of].
    intros ->. apply U in Q. subst k. destruct k0; discriminate.
  - apply in_flat in H; [|exact T]. destruct H as (i & j & k & H). apply IH in H; [exact H|].
    destruct (B i j k) as (_ & _ & C). destruct (has k0 (kid i j k t)); [rewrite C in F; congruence | reflexivity].
Qed.
End Sizes.
