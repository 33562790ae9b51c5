// taichi-soft for C#: steps worlds from `taichi-soft export` with the native library.
//
//     using (var scene = new Scene("game.softworld"))
//     using (var world = new World(scene))
//     {
//         Body ball = world.GetBody(scene.Find(NameKind.Body, "ball"));
//         for (;;)
//         {
//             world.Advance(secondsSinceLastFrame);
//             ball.ReadMesh(mesh, vertices, normals);
//         }
//     }
//
// A refused call throws a SoftException with the library's code and text. Only one thread at a time can call a world.
// After loading, memory is allocated only for exceptions and by methods that return an array or a string. All
// quantities use the axes and the unit of length for which the world was exported.
//
// This file is C# 7 without unsafe code, for .NET, Mono and Unity. Structs are passed by value, because Mono's compiler
// passes zeros if a method forwards an `in` parameter to the library.
using System;
using System.Runtime.CompilerServices;
using System.Runtime.ExceptionServices;
using System.Runtime.InteropServices;
using System.Text;

namespace TaichiSoft
{
    /// <summary>Reason for refusing a call.</summary>
    public enum ErrorCode
    {
        /// <summary>A value out of range, not finite, or null.</summary>
        Argument = -1,
        /// <summary>An unknown or destroyed scene, world or body.</summary>
        Handle = -2,
        /// <summary>Another thread is in a call of this world.</summary>
        Busy = -3,
        /// <summary>A missing, incomplete or damaged world file.</summary>
        File = -4,
        /// <summary>A world file or a library of another version.</summary>
        Version = -5,
        /// <summary>An array of the wrong size.</summary>
        Size = -6,
        /// <summary>A call that the current state does not allow: a full pool, an attached body.</summary>
        State = -7,
        /// <summary>Bytes that are not a snapshot of this world.</summary>
        Snapshot = -8,
        /// <summary>A failure of the system: memory, threads.</summary>
        Runtime = -9
    }

    /// <summary>Kinds of named objects in a scene.</summary>
    public enum NameKind
    {
        /// <summary>A slot for a body.</summary>
        Body = 0,
        /// <summary>Template of bodies.</summary>
        Asset = 1,
        /// <summary>A rigid shape that the game moves.</summary>
        Collider = 2,
        /// <summary>A pose that attached vertices follow.</summary>
        Frame = 3,
        /// <summary>Render mesh of an asset.</summary>
        Mesh = 4,
        /// <summary>Connection of two bodies.</summary>
        Joint = 5,
        /// <summary>Drive of a part of a body.</summary>
        Motor = 6
    }

    /// <summary>Status of a body.</summary>
    public enum BodyStatus
    {
        /// <summary>The body moves.</summary>
        Active = 0,
        /// <summary>The body became invalid and stays in its last valid state.</summary>
        Frozen = 1,
        /// <summary>The body rests and costs no time.</summary>
        Asleep = 2,
        /// <summary>The body was switched off, see SetEnabled.</summary>
        Disabled = 5
    }

    /// <summary>Exception of a refused call, with the library's code and text.</summary>
    public sealed class SoftException : Exception
    {
        /// <summary>Reason for refusing the call.</summary>
        public ErrorCode Code { get; private set; }

        /// <summary>Creates an exception with a code and a text.</summary>
        public SoftException(ErrorCode code, string message) : base(message)
        {
            Code = code;
        }
    }

    /// <summary>A vector: position, velocity or impulse, in the unit of length, kg and s; or spin [rad/s].</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Vector3d
    {
        /// <summary>Components along the axes.</summary>
        public double X, Y, Z;

        /// <summary>Creates a vector from its components.</summary>
        public Vector3d(double x, double y, double z)
        {
            X = x;
            Y = y;
            Z = z;
        }
    }

    /// <summary>A rotation as a unit quaternion.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Quaterniond
    {
        /// <summary>X, Y, Z: unit axis times the sine of half the angle. W: cosine of half the angle.</summary>
        public double X, Y, Z, W;

        /// <summary>Creates a quaternion from its components.</summary>
        public Quaterniond(double x, double y, double z, double w)
        {
            X = x;
            Y = y;
            Z = z;
            W = w;
        }

        /// <summary>No rotation.</summary>
        public static readonly Quaterniond Identity = new Quaterniond(0, 0, 0, 1);
    }

    /// <summary>Pose of a collider or a frame. In Unity, write TaichiSoft.Pose: UnityEngine has a Pose, too.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Pose
    {
        /// <summary>Position [unit of length].</summary>
        public Vector3d Position;
        /// <summary>Rotation, a unit quaternion.</summary>
        public Quaterniond Rotation;

        /// <summary>Creates a pose from a position and a rotation.</summary>
        public Pose(Vector3d position, Quaterniond rotation)
        {
            Position = position;
            Rotation = rotation;
        }
    }

    /// <summary>Initial state of a spawned body.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Placement
    {
        internal uint structSize;
        private readonly int reserved;
        /// <summary>Position of the mesh's origin [unit of length].</summary>
        public Vector3d Position;
        /// <summary>Rotation, a unit quaternion.</summary>
        public Quaterniond Rotation;
        /// <summary>Velocity of the centre of mass [unit of length/s].</summary>
        public Vector3d Velocity;
        /// <summary>Angular velocity [rad/s].</summary>
        public Vector3d Spin;

        /// <summary>Creates a placement at rest.</summary>
        public Placement(Vector3d position, Quaterniond rotation) : this()
        {
            Position = position;
            Rotation = rotation;
        }
    }

    /// <summary>Kinds of shapes of colliders.</summary>
    public enum ShapeKind
    {
        /// <summary>The solid below a plane. Size is not used.</summary>
        Plane = 0,
        /// <summary>A sphere. Size.X is the radius.</summary>
        Sphere = 1,
        /// <summary>A box. Size contains the lengths of the edges.</summary>
        Box = 2,
        /// <summary>A capsule along the up axis. Size.X is the radius, Size.Y the length between the centres.</summary>
        Capsule = 3
    }

    /// <summary>Shape and surface of a collider.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Shape
    {
        internal uint structSize;
        /// <summary>Kind, which defines the meaning of Size.</summary>
        public ShapeKind Kind;
        /// <summary>Size [unit of length], see ShapeKind.</summary>
        public Vector3d Size;
        /// <summary>Coulomb coefficient.</summary>
        public double Friction;
        /// <summary>Restitution, 0 to 1. Below 0, the restitution of the bodies is used.</summary>
        public double Restitution;
        /// <summary>Distance outside the shape at which contact begins [unit of length].</summary>
        public double Thickness;
        /// <summary>Bits. Two objects collide if the mask of each contains a bit of the other's group.</summary>
        public int Group;
        /// <summary>Bits of the groups with which the collider can collide, see Group.</summary>
        public int Mask;

        /// <summary>Creates a shape with default friction and restitution.</summary>
        public Shape(ShapeKind kind, Vector3d size) : this()
        {
            Kind = kind;
            Size = size;
            Friction = 0.5;
            Restitution = -1.0;
            Group = 1;
            Mask = -1;
        }
    }

    /// <summary>First hit of a ray, or the closest point of a surface.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Hit
    {
        internal uint structSize;
        /// <summary>Triangle of the body's surface, not of a mesh; -1 for a body without triangles.</summary>
        public readonly int Triangle;
        internal readonly ulong body;
        /// <summary>Distance from the start of the ray, or from the given point [unit of length].</summary>
        public readonly double Distance;
        /// <summary>Weights of the three vertices, with sum 1.</summary>
        public readonly Vector3d Weights;
        /// <summary>Position of the hit [unit of length].</summary>
        public readonly Vector3d Point;
        /// <summary>Outward unit normal.</summary>
        public readonly Vector3d Normal;
        /// <summary>Vertices of the triangle.</summary>
        public readonly int Vertex0, Vertex1, Vertex2;
        private readonly int isInside;

        /// <summary>True if the point that was given to Closest is inside the body.</summary>
        public bool IsInside
        {
            get { return isInside != 0; }
        }
    }

    /// <summary>Targets of a query.</summary>
    [Flags]
    public enum Targets
    {
        /// <summary>Surfaces of bodies.</summary>
        Bodies = 1,
        /// <summary>Colliders.</summary>
        Colliders = 2,
        /// <summary>Bodies and colliders.</summary>
        All = 3
    }

    /// <summary>A ray, or a shape that moves along a line without rotation.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Cast
    {
        internal uint structSize;
        private readonly int shape;
        private readonly Vector3d size;
        /// <summary>Pose of the shape at the start. A ray starts at its position.</summary>
        public Pose Pose;
        /// <summary>Direction, of any nonzero length.</summary>
        public Vector3d Direction;
        /// <summary>Largest distance [unit of length].</summary>
        public double MaxDistance;
        /// <summary>What is tested.</summary>
        public Targets Targets;
        /// <summary>Bits of the groups that are tested; -1 for all.</summary>
        public int Mask;

        /// <summary>Creates a ray without a limit that tests everything.</summary>
        public Cast(Vector3d origin, Vector3d direction) : this()
        {
            Pose = new Pose(origin, new Quaterniond(0, 0, 0, 1));
            Direction = direction;
            MaxDistance = double.PositiveInfinity;
            Targets = Targets.All;
            Mask = -1;
        }

        /// <summary>Creates a moving sphere, box or capsule without a limit that tests everything. Size: see ShapeKind.
        /// </summary>
        public Cast(ShapeKind kind, Vector3d size, Pose pose, Vector3d direction) : this(pose.Position, direction)
        {
            shape = (int)kind;
            this.size = size;
            Pose = pose;
        }
    }

    /// <summary>First touch of a ray or of a moving shape, or closest point of bodies and colliders.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Touch
    {
        internal uint structSize;
        /// <summary>Number of the collider; -1 for a body.</summary>
        public readonly int Collider;
        internal readonly ulong body;
        /// <summary>Triangle of the body's surface; -1 for a collider, and for a body without triangles.</summary>
        public readonly int Triangle;
        /// <summary>Vertices of the triangle, if a body is touched.</summary>
        public readonly int Vertex0, Vertex1, Vertex2;
        private readonly int isInside, reserved;
        /// <summary>Weights of the three vertices, with sum 1, if a body is touched.</summary>
        public readonly Vector3d Weights;
        /// <summary>Distance [unit of length]; 0 for a shape that overlaps at the start.</summary>
        public readonly double Distance;
        /// <summary>Depth of that overlap along the normal [unit of length], otherwise 0.</summary>
        public readonly double Depth;
        /// <summary>Position of the touch on the surface [unit of length].</summary>
        public readonly Vector3d Point;
        /// <summary>Unit normal, away from the body or collider.</summary>
        public readonly Vector3d Normal;

        /// <summary>True if the point that was given to Nearest is inside the body or collider.</summary>
        public bool IsInside
        {
            get { return isInside != 0; }
        }
    }

    /// <summary>Parameters of a grab: point, spring and target.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Pull
    {
        internal uint structSize;
        /// <summary>Triangle of the body's surface, as in Hit.</summary>
        public int Triangle;
        /// <summary>Weights of the triangle's vertices; 0 or more, with sum 1.</summary>
        public Vector3d Weights;
        /// <summary>Initial target [unit of length].</summary>
        public Vector3d Point;
        /// <summary>Frequency of the spring [Hz]; 5 feels like a hand.</summary>
        public double Frequency;
        /// <summary>Largest force. A number below 0 means ten times the body's weight on Earth.</summary>
        public double MaxForce;

        /// <summary>Creates a default grab at a point of a triangle.</summary>
        public Pull(int triangle, Vector3d weights, Vector3d point) : this()
        {
            Triangle = triangle;
            Weights = weights;
            Point = point;
            Frequency = 5.0;
            MaxForce = -1.0;
        }

        /// <summary>Creates a default grab at a hit.</summary>
        public Pull(Hit hit) : this(hit.Triangle, hit.Weights, hit.Point)
        {
        }
    }

    /// <summary>Settings of a motor.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Drive
    {
        internal uint structSize;
        private readonly int turns;
        private int isFixed;
        private int hasPoint;
        private readonly Vector3d axis;
        private Vector3d point;
        /// <summary>Target speed [rad/s], or [unit of length/s] for Push.</summary>
        public double Speed;
        /// <summary>Largest torque, or largest force for Push.</summary>
        public double Limit;

        private Drive(bool turns, Vector3d axis, double speed, double limit) : this()
        {
            this.turns = turns ? 1 : 0;
            this.axis = axis;
            Speed = speed;
            Limit = limit;
        }

        /// <summary>Rotates vertices about an axis through their centre. The axis rotates with the vertices.</summary>
        public static Drive Turn(Vector3d axis, double speed, double maxTorque)
        {
            return new Drive(true, axis, speed, maxTorque);
        }

        /// <summary>Pushes vertices along an axis. The axis rotates with the vertices.</summary>
        public static Drive Push(Vector3d axis, double speed, double maxForce)
        {
            return new Drive(false, axis, speed, maxForce);
        }

        /// <summary>Returns a copy whose axis is fixed in space.</summary>
        public Drive Fixed()
        {
            Drive found = this;
            found.isFixed = 1;
            return found;
        }

        /// <summary>Returns a copy whose axis is fixed in space and passes through a point.</summary>
        public Drive Through(Vector3d place)
        {
            Drive found = Fixed();
            found.hasPoint = 1;
            found.point = place;
            return found;
        }
    }

    /// <summary>Kinds of events, as bits.</summary>
    [Flags]
    public enum EventKinds
    {
        /// <summary>A body touches a collider or another body.</summary>
        ContactBegan = 1,
        /// <summary>Two objects have not touched for 0.05 s, or one of them was removed.</summary>
        ContactEnded = 2,
        /// <summary>A body fell asleep.</summary>
        FellAsleep = 4,
        /// <summary>A sleeping body woke.</summary>
        Woke = 8,
        /// <summary>A body became invalid and was frozen in its last valid state.</summary>
        Froze = 16,
        /// <summary>A body came into a sensor.</summary>
        Entered = 32,
        /// <summary>A body left a sensor, or one of the two was removed.</summary>
        Left = 64,
        /// <summary>A joint or an attachment broke. Impulse is that of the other body or of the frame on the body in the
        /// step. For an attachment, Collider is the number of the frame.</summary>
        Broke = 128,
        /// <summary>All kinds of events.</summary>
        All = ContactBegan | ContactEnded | FellAsleep | Woke | Froze | Entered | Left | Broke
    }

    /// <summary>Event of a step.</summary>
    public struct SoftEvent
    {
        /// <summary>Kind of the event.</summary>
        public readonly EventKinds Kind;
        /// <summary>Collider that the body touches, or sensor; -1 for another body or no contact.</summary>
        public readonly int Collider;
        /// <summary>Step of the world, from 0.</summary>
        public readonly long Step;
        /// <summary>Simulated time at the end of the step [s].</summary>
        public readonly double Time;
        /// <summary>Body of the event. Check IsAlive, because the body may have been removed.</summary>
        public readonly Body Body;
        /// <summary>Body in a higher slot that Body touches; IsSomebody is false if there is none.</summary>
        public readonly Body Other;
        /// <summary>Impulse that Body exerted in the step, or in the whole contact if the contact ended.</summary>
        public readonly Vector3d Impulse;
        /// <summary>Duration of a contact that ended [s].</summary>
        public readonly double Duration;

        internal SoftEvent(World world, ref PlainEvent plain)
        {
            Kind = plain.Kind;
            Collider = plain.Collider;
            Step = plain.Step;
            Time = plain.Time;
            Body = new Body(world, plain.Body);
            Other = new Body(world, plain.Other);
            Impulse = plain.Impulse;
            Duration = plain.Duration;
        }
    }

    // An event in the memory layout of the library.
    [StructLayout(LayoutKind.Sequential)]
    internal struct PlainEvent
    {
        internal readonly EventKinds Kind;
        internal readonly int Collider;
        internal readonly long Step;
        internal readonly double Time;
        internal readonly ulong Body, Other;
        internal readonly Vector3d Impulse;
        internal readonly double Duration;
    }

    /// <summary>Numbers of objects in a scene.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct SceneInfo
    {
        internal uint structSize;
        /// <summary>Largest number of bodies.</summary>
        public int SlotCount;
        /// <summary>Number of objects of each kind. The numbers of objects start at 0.</summary>
        public int AssetCount, ColliderCount, FrameCount, MeshCount;
    }

    /// <summary>Properties of an asset's bodies.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct AssetInfo
    {
        internal uint structSize;
        /// <summary>Number of vertices of a body.</summary>
        public int VertexCount;
        /// <summary>Largest number of bodies of this asset.</summary>
        public int SlotCount;
        /// <summary>Mass of a body [kg].</summary>
        public float Mass;
    }

    /// <summary>Properties of a render mesh.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct MeshInfo
    {
        internal uint structSize;
        /// <summary>Number of the mesh's asset.</summary>
        public int Asset;
        /// <summary>Number of vertices, and number of triangles.</summary>
        public int VertexCount, TriangleCount;
        private readonly int hasUv;

        /// <summary>True if the mesh has texture coordinates.</summary>
        public bool HasUv
        {
            get { return hasUv != 0; }
        }
    }

    /// <summary>Clock of a world.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Clock
    {
        internal uint structSize;
        /// <summary>Number of steps that the last Advance made.</summary>
        public int StepsMade;
        /// <summary>Total number of steps.</summary>
        public long Steps;
        /// <summary>Simulated time [s].</summary>
        public double Time;
        /// <summary>Interpolation factor between the states before (0) and after (1) the last step.</summary>
        public double Alpha;
        /// <summary>Total time that was dropped because frames were too long [s].</summary>
        public double Dropped;
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct FixedStep
    {
        internal uint structSize;
        internal int substeps;
        internal int maxSteps;
        internal double dt;
    }

    /// <summary>A world file in memory, with its kernels loaded.</summary>
    // This class uses no SafeHandle, which contains a pointer, because handles are 64-bit numbers on every machine. A
    // SafeHandle is not necessary, because the library refuses invalid handles and does not reuse handles.
    public sealed class Scene : IDisposable
    {
        private readonly ulong handle;
        private bool isDisposed;

        /// <summary>Reads a folder from `taichi-soft export`, and loads its kernels.</summary>
        public Scene(string folder)
        {
            if (Native.ts_version() != Native.Version)
            {
                throw new SoftException(
                    ErrorCode.Version, "the library has version " + Native.ts_version() + ": use version "
                    + Native.Version);
            }
            Native.Check(Native.ts_scene_load(Native.Bytes(folder), out handle), this);
        }

        /// <summary>Unloads the scene if Dispose was not called.</summary>
        ~Scene()
        {
            Release();
        }

        /// <summary>Unloads the scene. Existing worlds stay valid.</summary>
        public void Dispose()
        {
            Native.Check(Release(), this);
            GC.SuppressFinalize(this);
        }

        private int Release()
        {
            if (isDisposed || handle == 0) return 0;
            isDisposed = true;
            return Native.ts_scene_unload(handle);
        }

        internal ulong Handle
        {
            get { return handle; }
        }

        /// <summary>Returns the number of objects of each kind.</summary>
        public SceneInfo GetInfo()
        {
            var info = new SceneInfo { structSize = Size<SceneInfo>.Bytes };
            Native.Check(Native.ts_scene_get_info(handle, ref info), this);
            return info;
        }

        /// <summary>Returns the number of the object with a name. The number of a body is its slot.</summary>
        public int Find(NameKind kind, string name)
        {
            int number;
            Native.Check(Native.ts_scene_find(handle, (int)kind, Native.Bytes(name), out number), this);
            return number;
        }

        /// <summary>Returns the name of an object.</summary>
        public string GetName(NameKind kind, int number)
        {
            var name = new byte[256];
            int result = Native.ts_scene_get_name(handle, (int)kind, number, name, Native.Length(name));
            while (result == (int)ErrorCode.Size)
            {
                name = new byte[2 * name.Length];
                result = Native.ts_scene_get_name(handle, (int)kind, number, name, Native.Length(name));
            }
            Native.Check(result, this);
            return Encoding.UTF8.GetString(name, 0, Array.IndexOf(name, (byte)0));
        }

        /// <summary>Returns the properties of an asset's bodies.</summary>
        public AssetInfo GetAssetInfo(int asset)
        {
            var info = new AssetInfo { structSize = Size<AssetInfo>.Bytes };
            Native.Check(Native.ts_asset_get_info(handle, asset, ref info), this);
            return info;
        }

        /// <summary>Returns the number of levels of detail. AssetInfo describes the finest level.</summary>
        public int GetLevelCount(int asset)
        {
            int count;
            Native.Check(Native.ts_asset_get_level_count(handle, asset, out count), this);
            return count;
        }

        /// <summary>Returns the level of detail of a mesh; -1 for a skin, which is drawn at all levels.</summary>
        public int GetMeshLevel(int mesh)
        {
            int level;
            Native.Check(Native.ts_mesh_get_level(handle, mesh, out level), this);
            return level;
        }

        /// <summary>Returns the properties of a mesh.</summary>
        public MeshInfo GetMeshInfo(int mesh)
        {
            var info = new MeshInfo { structSize = Size<MeshInfo>.Bytes };
            Native.Check(Native.ts_mesh_get_info(handle, mesh, ref info), this);
            return info;
        }

        /// <summary>Reads triangles, 3 vertex numbers each. In Unity's axes they are clockwise from outside.</summary>
        public void GetTriangles(int mesh, int[] indices)
        {
            Native.Check(Native.ts_mesh_get_triangles(handle, mesh, indices, Native.Length(indices)), this);
        }

        /// <summary>Reads texture coordinates, 2 numbers per vertex; v points up.</summary>
        public void GetUv(int mesh, float[] uv)
        {
            Native.Check(Native.ts_mesh_get_uv(handle, mesh, uv, Native.Length(uv)), this);
        }
    }

    /// <summary>A running instance of a scene.</summary>
    public sealed class World : IDisposable
    {
        // The library calls a static method, because Unity's IL2CPP supports only static callbacks. The field keeps the
        // delegate from being collected. A weak handle refers to the world, so that the world can be collected.
        private static readonly Native.BeforeStep onStep = OnStep;

        private readonly ulong handle;
        private readonly PlainEvent[] drained = new PlainEvent[64];
        private readonly ulong[] found; // buffer for the handles of all bodies
        private GCHandle self;
        private bool isDisposed;
        private ExceptionDispatchInfo thrown;

        /// <summary>Creates a world in the exported state.</summary>
        public World(Scene scene)
        {
            found = new ulong[scene.GetInfo().SlotCount];
            Native.Check(Native.ts_world_create(scene.Handle, out handle), scene);
            self = GCHandle.Alloc(this, GCHandleType.Weak);
            Native.Check(Native.ts_world_on_step(handle, onStep, GCHandle.ToIntPtr(self)), this);
        }

        /// <summary>Destroys the world if Dispose was not called.</summary>
        ~World()
        {
            Release();
        }

        /// <summary>Destroys the world. If BeforeStep calls this method, Advance throws an exception.</summary>
        public void Dispose()
        {
            Native.Check(Release(), this);
            GC.SuppressFinalize(this);
        }

        private int Release()
        {
            if (isDisposed || handle == 0) return 0;
            int result = Native.ts_world_destroy(handle);
            if (result != 0) return result;
            isDisposed = true;
            if (self.IsAllocated) self.Free();
            return 0;
        }

        /// <summary>Function called before each step of Advance, to move colliders and frames and to apply forces.
        /// </summary>
        /// <remarks>If the function throws, Advance makes the remaining steps without calling it, and then throws the
        /// same exception.</remarks>
        public Action<World> BeforeStep { get; set; }

        [MonoPInvokeCallback(typeof(Native.BeforeStep))]
        private static void OnStep(ulong handle, IntPtr user)
        {
            var world = GCHandle.FromIntPtr(user).Target as World;
            if (world == null || world.BeforeStep == null || world.thrown != null) return;
            try
            {
                world.BeforeStep(world);
            }
            catch (Exception exception)
            {
                world.thrown = ExceptionDispatchInfo.Capture(exception); // must not pass through native code
            }
        }

        /// <summary>Sets the length of a step [s], the number of substeps (0 chooses a stable number), and the largest
        /// number of steps per call of Advance. Further time is dropped.</summary>
        public void SetFixedStep(double dt, int substeps = 0, int maxSteps = 8)
        {
            var step = new FixedStep
            {
                structSize = Size<FixedStep>.Bytes, substeps = substeps, maxSteps = maxSteps, dt = dt
            };
            Native.Check(Native.ts_world_set_fixed_step(handle, ref step), this);
        }

        /// <summary>Sets the number of threads for a step, including the calling thread: 1 to 256, by default the
        /// number of CPU threads. Results do not depend on the number of threads.</summary>
        public void SetThreads(int count)
        {
            Native.Check(Native.ts_world_set_threads(handle, count), this);
        }

        /// <summary>Makes one step of dt [s] with equal substeps. With 0 substeps, a stable number is chosen.</summary>
        public void Step(double dt, int substeps = 0)
        {
            Native.Check(Native.ts_world_step(handle, dt, substeps), this);
        }

        /// <summary>Adds the time of a frame [s] and makes the steps that are due.</summary>
        public Clock Advance(double seconds)
        {
            var clock = new Clock { structSize = Size<Clock>.Bytes };
            int result = Native.ts_world_advance(handle, seconds, ref clock);
            if (thrown != null)
            {
                ExceptionDispatchInfo first = thrown;
                thrown = null;
                first.Throw();
            }
            Native.Check(result, this);
            return clock;
        }

        /// <summary>Returns the clock. Its StepsMade is 0.</summary>
        public Clock GetClock()
        {
            var clock = new Clock { structSize = Size<Clock>.Bytes };
            Native.Check(Native.ts_world_get_clock(handle, ref clock), this);
            return clock;
        }

        /// <summary>Returns the number of substeps that a step of dt [s] currently needs to be stable.</summary>
        public int StableSubsteps(double dt)
        {
            int substeps;
            Native.Check(Native.ts_world_stable_substeps(handle, dt, out substeps), this);
            return substeps;
        }

        /// <summary>Wakes all bodies.</summary>
        public void Wake()
        {
            Native.Check(Native.ts_world_wake(handle), this);
        }

        /// <summary>Sets gravity [unit of length/s^2] from the next step on. Sleeping bodies wake.</summary>
        public void SetGravity(Vector3d gravity)
        {
            Native.Check(Native.ts_world_set_gravity(handle, ref gravity), this);
        }

        /// <summary>Moves the origin: subtracts an offset from all coordinates of the world.</summary>
        /// <remarks>Nothing moves relative to anything else, and sleeping bodies stay asleep.</remarks>
        public void ShiftOrigin(Vector3d offset)
        {
            Native.Check(Native.ts_world_shift_origin(handle, ref offset), this);
        }

        /// <summary>Draws relative to a point, such as the camera.</summary>
        /// <remarks>Positions and meshes of bodies are then relative to the point, computed before they are rounded to
        /// floats. All other coordinates stay those of the world.</remarks>
        public void SetViewOrigin(Vector3d point)
        {
            Native.Check(Native.ts_world_set_view_origin(handle, ref point), this);
        }

        /// <summary>Sets the Coulomb coefficient of the floor from the next step on.</summary>
        public void SetFriction(double friction)
        {
            Native.Check(Native.ts_world_set_friction(handle, friction), this);
        }

        /// <summary>Sets the wind: velocity, air density [kg/m^3] and drag coefficient.</summary>
        public void SetWind(Vector3d velocity, double density, double drag)
        {
            Native.Check(Native.ts_world_set_wind(handle, ref velocity, density, drag), this);
        }

        /// <summary>Pushes all vertices within a radius away from a point.</summary>
        public void RadialImpulse(Vector3d center, double impulse, double radius)
        {
            Native.Check(Native.ts_world_radial_impulse(handle, ref center, impulse, radius), this);
        }

        /// <summary>Returns a hash of the state. A world of Python in the same state has the same hash.</summary>
        public ulong Hash()
        {
            ulong hash;
            Native.Check(Native.ts_world_hash(handle, out hash), this);
            return hash;
        }

        /// <summary>Returns the current size of a snapshot [bytes], which depends on contacts, grabs and attachments.</summary>
        public int SnapshotSize()
        {
            UIntPtr size;
            Native.Check(Native.ts_world_snapshot(handle, null, UIntPtr.Zero, out size), this);
            return checked((int)size.ToUInt64());
        }

        /// <summary>Writes the state to a buffer of at least SnapshotSize bytes. Returns: bytes written.</summary>
        public int Snapshot(byte[] buffer)
        {
            UIntPtr size;
            if (buffer == null) throw new ArgumentNullException("buffer");
            Native.Check(Native.ts_world_snapshot(handle, buffer, Native.Length(buffer), out size), this);
            return checked((int)size.ToUInt64());
        }

        /// <summary>Returns the state as bytes.</summary>
        public byte[] Snapshot()
        {
            var buffer = new byte[SnapshotSize()];
            Snapshot(buffer);
            return buffer;
        }

        /// <summary>Restores a state.</summary>
        public void Restore(byte[] bytes)
        {
            Native.Check(Native.ts_world_restore(handle, bytes, Native.Length(bytes)), this);
        }

        /// <summary>Restores a state from the first bytes of a buffer.</summary>
        public void Restore(byte[] buffer, int size)
        {
            if (buffer == null || size < 0 || size > buffer.Length) throw new ArgumentOutOfRangeException("size");
            Native.Check(Native.ts_world_restore(handle, buffer, new UIntPtr((uint)size)), this);
        }

        /// <summary>Records only events of these kinds from the next step on; 0 records none.</summary>
        /// <remarks>Existing contacts count as beginning in the next step.</remarks>
        public void RecordEvents(EventKinds kinds)
        {
            Native.Check(Native.ts_world_record_events(handle, (int)kinds), this);
        }

        /// <summary>Removes the oldest waiting events and writes them to an array, as many as fit. Returns: number of
        /// events.</summary>
        public int DrainEvents(SoftEvent[] events)
        {
            if (events == null) throw new ArgumentNullException("events");
            int made = 0;
            while (made < events.Length)
            {
                UIntPtr size;
                int room = Math.Min(drained.Length, events.Length - made);
                Native.Check(
                    Native.ts_world_drain_events(
                        handle, ref drained[0], new UIntPtr(Size<PlainEvent>.Bytes), new UIntPtr((uint)room), out size),
                    this);
                int count = (int)size.ToUInt64();
                for (int i = 0; i < count; ++i) events[made + i] = new SoftEvent(this, ref drained[i]);
                made += count;
                if (count < room) break;
            }
            return made;
        }

        /// <summary>Returns the total number of events dropped because too many waited.</summary>
        public long DroppedEvents()
        {
            long count;
            Native.Check(Native.ts_world_dropped_events(handle, out count), this);
            return count;
        }

        /// <summary>Spawns a body in a free slot of its asset.</summary>
        public Body Spawn(int asset, Placement place)
        {
            ulong body;
            place.structSize = Size<Placement>.Bytes;
            Native.Check(Native.ts_world_spawn(handle, asset, ref place, out body), this);
            return new Body(this, body);
        }

        /// <summary>Returns the body in a slot; IsSomebody is false if the slot is empty.</summary>
        public Body GetBody(int slot)
        {
            ulong body;
            Native.Check(Native.ts_world_get_body(handle, slot, out body), this);
            return new Body(this, body);
        }

        /// <summary>Finds the first surface that a ray hits from outside. Returns: false if there is none.</summary>
        public bool Raycast(Vector3d origin, Vector3d direction, double maxDistance, out Hit hit, out Body body)
        {
            hit = new Hit { structSize = Size<Hit>.Bytes };
            Native.Check(Native.ts_world_raycast(handle, ref origin, ref direction, maxDistance, ref hit), this);
            body = new Body(this, hit.body);
            return hit.body != 0;
        }

        /// <summary>Finds the point of all surfaces that is closest to a point. Returns: false if there is none within
        /// maxDistance.</summary>
        public bool Closest(Vector3d point, double maxDistance, out Hit hit, out Body body)
        {
            hit = new Hit { structSize = Size<Hit>.Bytes };
            Native.Check(Native.ts_world_closest(handle, ref point, maxDistance, ref hit), this);
            body = new Body(this, hit.body);
            return hit.body != 0;
        }

        /// <summary>Finds the first touch of a ray or of a moving shape. Returns: false if there is none.</summary>
        /// <remarks>If a collider is touched, body.IsSomebody is false.</remarks>
        public bool Cast(Cast cast, out Touch touch, out Body body)
        {
            touch = new Touch { structSize = Size<Touch>.Bytes };
            cast.structSize = Size<Cast>.Bytes;
            Native.Check(Native.ts_world_cast(handle, ref cast, ref touch), this);
            body = new Body(this, touch.body);
            return touch.body != 0 || touch.Collider >= 0;
        }

        /// <summary>Finds the point of bodies and colliders that is closest to a point. Returns: false if there is none
        /// within maxDistance.</summary>
        public bool Nearest(Vector3d point, double maxDistance, Targets targets, int mask, out Touch touch, out Body body)
        {
            touch = new Touch { structSize = Size<Touch>.Bytes };
            Native.Check(Native.ts_world_nearest(handle, ref point, maxDistance, (int)targets, mask, ref touch), this);
            body = new Body(this, touch.body);
            return touch.body != 0 || touch.Collider >= 0;
        }

        /// <summary>Finds the bodies that touch or enclose a sphere, in the order of slots. Returns: number of bodies.
        /// </summary>
        /// <remarks>An array of SlotCount bodies is always large enough.</remarks>
        public int OverlapSphere(Vector3d center, double radius, Body[] bodies)
        {
            UIntPtr count;
            Native.Check(
                Native.ts_world_overlap_sphere(handle, ref center, radius, found, RoomOf(bodies), out count), this);
            return Copy(count, bodies);
        }

        /// <summary>Finds the bodies that touch or enclose a box with edges of `size`, see OverlapSphere.</summary>
        public int OverlapBox(Pose pose, Vector3d size, Body[] bodies)
        {
            UIntPtr count;
            Native.Check(
                Native.ts_world_overlap_box(handle, ref pose, ref size, found, RoomOf(bodies), out count), this);
            return Copy(count, bodies);
        }

        private UIntPtr RoomOf(Body[] bodies)
        {
            if (bodies == null) throw new ArgumentNullException("bodies");
            return new UIntPtr((uint)Math.Min(bodies.Length, found.Length));
        }

        private int Copy(UIntPtr size, Body[] bodies)
        {
            int count = (int)size.ToUInt64();
            for (int i = 0; i < count; ++i) bodies[i] = new Body(this, found[i]);
            return count;
        }

        /// <summary>Returns the grab with an index, 0 to 15; IsThere is false if there is none.</summary>
        /// <remarks>The exported world can also contain grabs.</remarks>
        public Grab GetGrab(int number)
        {
            ulong grab;
            Native.Check(Native.ts_world_get_grab(handle, number, out grab), this);
            return new Grab(this, grab);
        }

        /// <summary>Returns the joint with an index, 0 to 63; IsThere is false if there is none.</summary>
        public Joint GetJoint(int number)
        {
            ulong joint;
            Native.Check(Native.ts_world_get_joint(handle, number, out joint), this);
            return new Joint(this, joint);
        }

        /// <summary>Returns the motor with an index, 0 to 63; IsThere is false if there is none.</summary>
        public Motor GetMotor(int number)
        {
            ulong motor;
            Native.Check(Native.ts_world_get_motor(handle, number, out motor), this);
            return new Motor(this, motor);
        }

        /// <summary>Adds a collider. Returns: number of the collider.</summary>
        /// <remarks>The world must have space for another collider, see World(collider_room=...) in Python.</remarks>
        public int AddCollider(Shape shape, Pose pose)
        {
            int collider;
            shape.structSize = Size<Shape>.Bytes;
            Native.Check(Native.ts_collider_add(handle, ref shape, ref pose, out collider), this);
            return collider;
        }

        /// <summary>Adds a sensor: a collider that bodies do not touch, and that reports the bodies in it by the
        /// events Entered and Left. Returns: number of the sensor.</summary>
        /// <remarks>Move and remove it as a collider. Only size, group and mask of the shape are used.</remarks>
        public int AddSensor(Shape shape, Pose pose)
        {
            int sensor;
            shape.structSize = Size<Shape>.Bytes;
            Native.Check(Native.ts_sensor_add(handle, ref shape, ref pose, out sensor), this);
            return sensor;
        }

        /// <summary>Finds the bodies that touch or enclose a sensor, see OverlapSphere.</summary>
        public int BodiesInside(int sensor, Body[] bodies)
        {
            UIntPtr count;
            Native.Check(Native.ts_sensor_get_bodies(handle, sensor, found, RoomOf(bodies), out count), this);
            return Copy(count, bodies);
        }

        /// <summary>Removes a collider.</summary>
        public void RemoveCollider(int collider)
        {
            Native.Check(Native.ts_collider_remove(handle, collider), this);
        }

        /// <summary>Moves a collider to a pose over the next step. The collider pushes bodies in its path.</summary>
        public void MoveCollider(int collider, Pose pose)
        {
            Native.Check(Native.ts_collider_move_to(handle, collider, ref pose), this);
        }

        /// <summary>Moves a collider at a constant velocity and angular velocity [rad/s].</summary>
        public void SetColliderVelocity(int collider, Vector3d linear, Vector3d spin)
        {
            Native.Check(Native.ts_collider_set_velocity(handle, collider, ref linear, ref spin), this);
        }

        /// <summary>Sets group and mask of a collider or a sensor from the next step on.</summary>
        public void SetColliderFilter(int collider, int group, int mask)
        {
            Native.Check(Native.ts_collider_set_filter(handle, collider, group, mask), this);
        }

        /// <summary>Moves the surface of a collider like a conveyor belt. The velocity is relative to the collider, in
        /// its axes; zero stops the surface.</summary>
        public void SetSurfaceVelocity(int collider, Vector3d velocity)
        {
            Native.Check(Native.ts_collider_set_surface_velocity(handle, collider, ref velocity), this);
        }

        /// <summary>Moves a collider at once, without pushing bodies.</summary>
        public void TeleportCollider(int collider, Pose pose)
        {
            Native.Check(Native.ts_collider_teleport(handle, collider, ref pose), this);
        }

        /// <summary>Sets the Coulomb coefficient of a collider from the next step on.</summary>
        public void SetColliderFriction(int collider, double friction)
        {
            Native.Check(Native.ts_collider_set_friction(handle, collider, friction), this);
        }

        /// <summary>Returns the pose of a collider.</summary>
        public Pose GetColliderPose(int collider)
        {
            Pose pose;
            Native.Check(Native.ts_collider_get_pose(handle, collider, out pose), this);
            return pose;
        }

        /// <summary>Returns the impulse of all bodies on a collider in the last step, and the angular impulse about the
        /// collider's position.</summary>
        public void GetColliderImpulse(int collider, out Vector3d impulse, out Vector3d moment)
        {
            Native.Check(Native.ts_collider_get_impulse(handle, collider, out impulse, out moment), this);
        }

        /// <summary>Adds a frame, a pose that the game moves: a bone, a vehicle, a hand. Returns: number of the frame.
        /// </summary>
        public int AddFrame(Pose pose)
        {
            int frame;
            Native.Check(Native.ts_frame_add(handle, ref pose, out frame), this);
            return frame;
        }

        /// <summary>Removes a frame and detaches its vertices.</summary>
        public void RemoveFrame(int frame)
        {
            Native.Check(Native.ts_frame_remove(handle, frame), this);
        }

        /// <summary>Returns the pose of a frame.</summary>
        public Pose GetFramePose(int frame)
        {
            Pose pose;
            Native.Check(Native.ts_frame_get_pose(handle, frame, out pose), this);
            return pose;
        }

        /// <summary>Moves a frame and its attached vertices to a pose over the next step.</summary>
        public void MoveFrame(int frame, Pose pose)
        {
            Native.Check(Native.ts_frame_move_to(handle, frame, ref pose), this);
        }

        internal ulong Handle
        {
            get { return handle; }
        }
    }

    /// <summary>A body of a world. A later body in its slot is a different Body.</summary>
    public struct Body
    {
        private readonly World world;

        /// <summary>The library's handle; 0 for none.</summary>
        public readonly ulong Id;

        internal Body(World world, ulong id)
        {
            this.world = world;
            Id = id;
        }

        /// <summary>True if there was a body in the slot.</summary>
        public bool IsSomebody
        {
            get { return Id != 0; }
        }

        /// <summary>True if the body is still in the world.</summary>
        public bool IsAlive
        {
            get
            {
                int status;
                if (Id == 0) return false;
                int result = Native.ts_body_get_status(World.Handle, Id, out status);
                if (result == (int)ErrorCode.Handle) return false;
                Check(result);
                return true;
            }
        }

        /// <summary>World of the body.</summary>
        public World World
        {
            get
            {
                if (world == null) throw new SoftException(ErrorCode.Handle, "this body is of no world");
                return world;
            }
        }

        private void Check(int result)
        {
            Native.Check(result, world);
        }

        /// <summary>Removes the body from the world.</summary>
        public void Despawn()
        {
            Check(Native.ts_world_despawn(World.Handle, Id));
        }

        /// <summary>Returns the number of the body's asset.</summary>
        public int GetAsset()
        {
            int asset;
            Check(Native.ts_body_get_asset(World.Handle, Id, out asset));
            return asset;
        }

        /// <summary>Returns the status of the body.</summary>
        public BodyStatus GetStatus()
        {
            int status;
            Check(Native.ts_body_get_status(World.Handle, Id, out status));
            return (BodyStatus)status;
        }

        /// <summary>Level of detail; 0 is the finest.</summary>
        public int Level
        {
            get
            {
                int level;
                Check(Native.ts_body_get_level(World.Handle, Id, out level));
                return level;
            }
        }

        /// <summary>Number of vertices at the current level of detail.</summary>
        public int VertexCount
        {
            get
            {
                int count;
                Check(Native.ts_body_get_vertex_count(World.Handle, Id, out count));
                return count;
            }
        }

        /// <summary>Changes the level of detail. The vertices and triangles of the body then change.</summary>
        /// <remarks>If joints, motors or attachments cannot be kept, they are released if `release` is true; otherwise
        /// the call fails.</remarks>
        public void SetLevel(int level, bool release = false)
        {
            Check(Native.ts_body_set_level(World.Handle, Id, level, release ? 1 : 0));
        }

        /// <summary>Reads the positions of all vertices, 3 numbers each, interpolated between the states before (alpha
        /// 0) and after (alpha 1) the last step.</summary>
        public void ReadPositions(double alpha, float[] positions)
        {
            Check(Native.ts_body_positions(World.Handle, Id, alpha, positions, Native.Length(positions)));
        }

        /// <summary>Reads positions and normals, interpolated by Clock.Alpha, 3 numbers per vertex each.</summary>
        /// <remarks>`normals` can be null.</remarks>
        public void ReadMesh(int mesh, float[] positions, float[] normals)
        {
            if (normals != null && positions != null && normals.Length != positions.Length)
            {
                throw new SoftException(
                    ErrorCode.Size, "normals has room for " + normals.Length + " numbers: give room for "
                    + positions.Length);
            }
            Check(Native.ts_body_mesh(World.Handle, Id, mesh, positions, normals, Native.Length(positions)));
        }

        /// <summary>Reads positions and normals into pinned memory, such as a pinned Vector3[] of an engine.</summary>
        /// <remarks>Both buffers must have space for `count` numbers; `normals` can be IntPtr.Zero.</remarks>
        public void ReadMesh(int mesh, IntPtr positions, IntPtr normals, int count)
        {
            if (count < 0) throw new ArgumentOutOfRangeException("count");
            Check(Native.ts_body_mesh(World.Handle, Id, mesh, positions, normals, new UIntPtr((uint)count)));
        }

        /// <summary>Returns the centre of mass.</summary>
        public Vector3d GetCenter()
        {
            Vector3d center;
            Check(Native.ts_body_center(World.Handle, Id, out center));
            return center;
        }

        /// <summary>Sets the velocity of the centre of mass, and the spin about it [rad/s].</summary>
        public void SetVelocity(Vector3d linear, Vector3d spin)
        {
            Check(Native.ts_body_set_velocity(World.Handle, Id, ref linear, ref spin));
        }

        /// <summary>Moves the centre of mass to a position and rotates the current shape by `turn`. The body keeps its
        /// velocity if `keepsVelocity` is true; otherwise it is at rest.</summary>
        public void Teleport(Vector3d center, Quaterniond turn, bool keepsVelocity = false)
        {
            Check(Native.ts_body_teleport(World.Handle, Id, ref center, ref turn, keepsVelocity ? 1 : 0));
        }

        /// <summary>Applies an impulse to a list of vertices; null means all vertices.</summary>
        public void ApplyImpulse(Vector3d impulse, int[] vertices = null)
        {
            Check(Native.ts_body_apply_impulse(World.Handle, Id, ref impulse, vertices, Native.Count(vertices)));
        }

        /// <summary>Applies a force during the next step to a list of vertices; null means all vertices.</summary>
        public void ApplyForce(Vector3d force, int[] vertices = null)
        {
            Check(Native.ts_body_apply_force(World.Handle, Id, ref force, vertices, Native.Count(vertices)));
        }

        /// <summary>Applies an impulse to the vertices within a radius of a point.</summary>
        public void ImpulseAt(Vector3d impulse, Vector3d point, double radius)
        {
            Check(Native.ts_body_impulse_at(World.Handle, Id, ref impulse, ref point, radius));
        }

        /// <summary>Sets the factor by which the world's gravity is multiplied for this body.</summary>
        public void SetGravityScale(double scale)
        {
            Check(Native.ts_body_set_gravity_scale(World.Handle, Id, scale));
        }

        /// <summary>Sets the Coulomb coefficient for contact with other bodies, in worlds with soft contact.</summary>
        public void SetFriction(double friction)
        {
            Check(Native.ts_body_set_friction(World.Handle, Id, friction));
        }

        /// <summary>Sets group and mask from the next step on. Contacts with what the body no longer touches end at
        /// once.</summary>
        public void SetFilter(int group, int mask)
        {
            Check(Native.ts_body_set_filter(World.Handle, Id, group, mask));
        }

        /// <summary>Sets the damping rate of the body's velocity [1/s].</summary>
        public void SetDamping(double rate)
        {
            Check(Native.ts_body_set_damping(World.Handle, Id, rate));
        }

        /// <summary>Switches the body off or on. A body that is off keeps its shape and velocity, and costs no time: it
        /// does not move, and nothing touches or finds it. Hide its mesh.</summary>
        public void SetEnabled(bool isEnabled)
        {
            Check(Native.ts_body_set_enabled(World.Handle, Id, isEnabled ? 1 : 0));
        }

        /// <summary>Shelters the body from the wind, or exposes it.</summary>
        public void SetSheltered(bool isSheltered)
        {
            Check(Native.ts_body_set_sheltered(World.Handle, Id, isSheltered ? 1 : 0));
        }

        /// <summary>Pins vertices at their positions.</summary>
        public void Pin(int[] vertices)
        {
            Check(Native.ts_body_pin(World.Handle, Id, vertices, Native.Count(vertices)));
        }

        /// <summary>Releases pinned vertices; null means all pinned vertices.</summary>
        public void Unpin(int[] vertices = null)
        {
            Check(Native.ts_body_unpin(World.Handle, Id, vertices, Native.Count(vertices)));
        }

        /// <summary>Sets the positions of pinned vertices after the next step, 3 numbers each.</summary>
        public void SetTargets(int[] vertices, float[] targets)
        {
            int needed = vertices == null ? 0 : 3 * vertices.Length;
            if (targets != null && targets.Length != needed)
            {
                throw new SoftException(
                    ErrorCode.Size, "targets has " + targets.Length + " numbers: give " + needed);
            }
            Check(Native.ts_body_set_targets(World.Handle, Id, vertices, Native.Count(vertices), targets));
        }

        /// <summary>Attaches vertices to a frame at their current positions.</summary>
        /// <remarks>Set `feels` to use GetLoad later.</remarks>
        public void Attach(int[] vertices, int frame, bool feels = false)
        {
            Check(Native.ts_body_attach(World.Handle, Id, vertices, Native.Count(vertices), frame, feels ? 1 : 0));
        }

        /// <summary>Detaches vertices from frames; null means all. The vertices keep their velocity.</summary>
        public void Detach(int[] vertices = null)
        {
            Check(Native.ts_body_detach(World.Handle, Id, vertices, Native.Count(vertices)));
        }

        /// <summary>Attaches vertices to the body `other` at their current positions or, if `onto` is not null, each to
        /// a vertex in `onto`.</summary>
        public Joint Join(int[] vertices, Body other, int[] onto = null)
        {
            if (onto != null && (vertices == null || onto.Length != vertices.Length))
            {
                throw new SoftException(ErrorCode.Size, "onto must have as many vertices as vertices");
            }
            ulong joint;
            Check(Native.ts_body_join(World.Handle, Id, vertices, Native.Count(vertices), other.Id, onto, out joint));
            return new Joint(World, joint);
        }

        /// <summary>Connects this rigid body to `other` at the point `anchor`, where the two are now. The axis of a hinge or
        /// a slider can have any length. A slider connects two rigid bodies.</summary>
        public Joint Connect(Body other, JointKind kind, Vector3d anchor, Vector3d axis)
        {
            ulong joint;
            Check(Native.ts_body_connect(World.Handle, Id, other.Id, (int)kind, ref anchor, ref axis, out joint));
            return new Joint(World, joint);
        }

        /// <summary>Adds a motor that rotates or pushes vertices.</summary>
        public Motor AddMotor(int[] vertices, Drive drive)
        {
            ulong motor;
            drive.structSize = Size<Drive>.Bytes;
            Check(
                Native.ts_body_add_motor(World.Handle, Id, vertices, Native.Count(vertices), ref drive, out motor));
            return new Motor(World, motor);
        }

        /// <summary>Sets the mean force of a step above which each attachment to a frame breaks; 0 for never.</summary>
        /// <remarks>The body must be attached with `feels`.</remarks>
        public void SetBreakForce(int frame, double force)
        {
            Check(Native.ts_body_set_break_force(World.Handle, Id, frame, force));
        }

        /// <summary>Returns the mean force on a frame in the last step, and the mean torque about the frame's origin.
        /// </summary>
        public void GetLoad(int frame, out Vector3d force, out Vector3d torque)
        {
            Check(Native.ts_body_get_load(World.Handle, Id, frame, out force, out torque));
        }

        /// <summary>Grabs the surface of the body. A world has at most 16 grabs.</summary>
        public Grab Grab(Pull pull)
        {
            ulong grab;
            pull.structSize = Size<Pull>.Bytes;
            Check(Native.ts_body_grab(World.Handle, Id, ref pull, out grab));
            return new Grab(World, grab);
        }
    }

    /// <summary>A grab of a body. A later grab at its index is a different Grab.</summary>
    public struct Grab
    {
        private readonly World world;

        /// <summary>The library's handle; 0 for none.</summary>
        public readonly ulong Id;

        internal Grab(World world, ulong id)
        {
            this.world = world;
            Id = id;
        }

        /// <summary>True if there was a grab at the index.</summary>
        public bool IsThere
        {
            get { return Id != 0; }
        }

        /// <summary>World of the grab.</summary>
        public World World
        {
            get
            {
                if (world == null) throw new SoftException(ErrorCode.Handle, "this grab is of no world");
                return world;
            }
        }

        private void Check(int result)
        {
            Native.Check(result, world);
        }

        /// <summary>Moves the target from the next step on.</summary>
        public void Move(Vector3d point)
        {
            Check(Native.ts_grab_move(World.Handle, Id, ref point));
        }

        /// <summary>Releases the grab.</summary>
        public void Release()
        {
            Check(Native.ts_grab_release(World.Handle, Id));
        }

        /// <summary>Returns the force of the grab in the last substep.</summary>
        public Vector3d GetForce()
        {
            Vector3d force;
            Check(Native.ts_grab_get_force(World.Handle, Id, out force));
            return force;
        }
    }

    /// <summary>Motion of a rigid body relative to the body to which it is connected.</summary>
    public enum JointKind
    {
        /// <summary>Turns about a point.</summary>
        Ball = 0,
        /// <summary>Turns about an axis.</summary>
        Hinge = 1,
        /// <summary>Moves along an axis.</summary>
        Slider = 2,
        /// <summary>Does not move.</summary>
        Fixed = 3
    }

    /// <summary>A joint between two bodies.</summary>
    public struct Joint
    {
        private readonly World world;

        /// <summary>The library's handle; 0 for none.</summary>
        public readonly ulong Id;

        internal Joint(World world, ulong id)
        {
            this.world = world;
            Id = id;
        }

        /// <summary>True if the index was in use when the handle was read.</summary>
        public bool IsThere
        {
            get { return Id != 0; }
        }

        /// <summary>World of the joint.</summary>
        public World World
        {
            get
            {
                if (world == null) throw new SoftException(ErrorCode.Handle, "this joint is of no world");
                return world;
            }
        }

        /// <summary>Releases the joint.</summary>
        public void Release()
        {
            Native.Check(Native.ts_joint_release(World.Handle, Id), world);
        }

        /// <summary>Sets the mean force of a step above which the joint breaks; 0 for never.</summary>
        public void SetBreakForce(double force)
        {
            Native.Check(Native.ts_joint_set_break_force(World.Handle, Id, force), world);
        }

        /// <summary>Returns the mean force of the other body in the last step.</summary>
        public Vector3d GetForce()
        {
            Vector3d force;
            Native.Check(Native.ts_joint_get_force(World.Handle, Id, out force), world);
            return force;
        }
    }

    /// <summary>A motor that rotates or pushes a part of a body.</summary>
    public struct Motor
    {
        private readonly World world;

        /// <summary>The library's handle; 0 for none.</summary>
        public readonly ulong Id;

        internal Motor(World world, ulong id)
        {
            this.world = world;
            Id = id;
        }

        /// <summary>True if the index was in use when the handle was read.</summary>
        public bool IsThere
        {
            get { return Id != 0; }
        }

        /// <summary>World of the motor.</summary>
        public World World
        {
            get
            {
                if (world == null) throw new SoftException(ErrorCode.Handle, "this motor is of no world");
                return world;
            }
        }

        /// <summary>Sets the target speed.</summary>
        public void SetSpeed(double speed)
        {
            Native.Check(Native.ts_motor_set_speed(World.Handle, Id, speed), world);
        }

        /// <summary>Sets the largest torque or force. With 0 the vertices coast.</summary>
        public void SetLimit(double limit)
        {
            Native.Check(Native.ts_motor_set_limit(World.Handle, Id, limit), world);
        }

        /// <summary>Returns the speed of the driven vertices after the last step.</summary>
        public double GetSpeed()
        {
            double speed;
            Native.Check(Native.ts_motor_get_speed(World.Handle, Id, out speed), world);
            return speed;
        }

        /// <summary>Returns the mean torque or force of the motor in the last step.</summary>
        public double GetEffort()
        {
            double effort;
            Native.Check(Native.ts_motor_get_effort(World.Handle, Id, out effort), world);
            return effort;
        }

        /// <summary>Removes the motor.</summary>
        public void Remove()
        {
            Native.Check(Native.ts_motor_remove(World.Handle, Id), world);
        }
    }

    // Unity's IL2CPP finds this attribute by its name, so Unity's own attribute is not required.
    [AttributeUsage(AttributeTargets.Method)]
    internal sealed class MonoPInvokeCallbackAttribute : Attribute
    {
        public MonoPInvokeCallbackAttribute(Type type)
        {
        }
    }

    internal static class Size<T>
    {
        internal static readonly uint Bytes = (uint)Marshal.SizeOf(typeof(T));
    }

    // The functions of taichi_soft.h. The method Bytes converts strings to zero-terminated UTF-8, because .NET's
    // conversion depends on the system.
    internal static class Native
    {
        internal const uint Version = 1;
        private const string Library = "taichi_soft";
        private const CallingConvention C = CallingConvention.Cdecl;

        [UnmanagedFunctionPointer(C)]
        internal delegate void BeforeStep(ulong world, IntPtr user);

        internal static byte[] Bytes(string text)
        {
            if (text == null) return null;
            if (text.IndexOf('\0') >= 0) throw new SoftException(ErrorCode.Argument, "a name or folder has a zero");
            return Encoding.UTF8.GetBytes(text + "\0");
        }

        internal static UIntPtr Length(Array array)
        {
            return array == null ? UIntPtr.Zero : new UIntPtr((uint)array.Length);
        }

        // Length of a list of vertices. An empty list is refused, because for the library it means all vertices.
        internal static UIntPtr Count(int[] vertices)
        {
            if (vertices != null && vertices.Length == 0)
            {
                throw new SoftException(ErrorCode.Argument, "no vertex is named: give null for all");
            }
            return Length(vertices);
        }

        // The parameter `owner` keeps the owner from being finalised during the call.
        [MethodImpl(MethodImplOptions.NoInlining)]
        internal static void Check(int result, object owner)
        {
            GC.KeepAlive(owner);
            if (result != 0) throw new SoftException((ErrorCode)result, LastError());
        }

        private static string LastError()
        {
            IntPtr text = ts_last_error();
            int length = 0;
            while (Marshal.ReadByte(text, length) != 0) ++length;
            var bytes = new byte[length];
            Marshal.Copy(text, bytes, 0, length);
            return Encoding.UTF8.GetString(bytes);
        }

        [DllImport(Library, CallingConvention = C)]
        internal static extern uint ts_version();

        [DllImport(Library, CallingConvention = C)]
        internal static extern IntPtr ts_last_error();

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_load(byte[] folder, out ulong scene);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_load_linked(byte[] world, UIntPtr size, IntPtr kernels, out ulong scene);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_unload(ulong scene);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_get_info(ulong scene, ref SceneInfo info);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_find(ulong scene, int kind, byte[] name, out int number);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_get_name(ulong scene, int kind, int number, byte[] name,
            UIntPtr capacity);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_asset_get_info(ulong scene, int asset, ref AssetInfo info);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_mesh_get_info(ulong scene, int mesh, ref MeshInfo info);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_mesh_get_triangles(ulong scene, int mesh, int[] indices, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_mesh_get_uv(ulong scene, int mesh, float[] uv, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_create(ulong scene, out ulong world);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_destroy(ulong world);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_fixed_step(ulong world, ref FixedStep step);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_on_step(ulong world, BeforeStep function, IntPtr user);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_threads(ulong world, int count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_job_system(ulong world, IntPtr function, IntPtr user);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_step(ulong world, double dt, int substeps);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_advance(ulong world, double seconds, ref Clock clock);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_get_clock(ulong world, ref Clock clock);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_stable_substeps(ulong world, double dt, out int substeps);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_wake(ulong world);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_gravity(ulong world, ref Vector3d gravity);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_shift_origin(ulong world, ref Vector3d offset);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_view_origin(ulong world, ref Vector3d point);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_friction(ulong world, double friction);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_wind(ulong world, ref Vector3d velocity, double density, double drag);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_radial_impulse(ulong world, ref Vector3d center, double impulse,
            double radius);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_hash(ulong world, out ulong hash);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_snapshot(ulong world, byte[] buffer, UIntPtr capacity, out UIntPtr size);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_restore(ulong world, byte[] bytes, UIntPtr size);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_record_events(ulong world, int kinds);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_drain_events(ulong world, ref PlainEvent events, UIntPtr event_size,
            UIntPtr capacity, out UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_dropped_events(ulong world, out long count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_spawn(ulong world, int asset, ref Placement place, out ulong body);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_despawn(ulong world, ulong body);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_get_body(ulong world, int slot, out ulong body);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_get_asset(ulong world, ulong body, out int asset);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_get_status(ulong world, ulong body, out int status);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_level(ulong world, ulong body, int level, int release);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_get_level(ulong world, ulong body, out int level);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_get_vertex_count(ulong world, ulong body, out int count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_asset_get_level_count(ulong scene, int asset, out int count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_mesh_get_level(ulong scene, int mesh, out int level);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_positions(ulong world, ulong body, double alpha, float[] positions,
            UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_mesh(ulong world, ulong body, int mesh, float[] positions, float[] normals,
            UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_mesh(ulong world, ulong body, int mesh, IntPtr positions, IntPtr normals,
            UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_center(ulong world, ulong body, out Vector3d center);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_velocity(ulong world, ulong body, ref Vector3d linear,
            ref Vector3d spin);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_teleport(ulong world, ulong body, ref Vector3d center, ref Quaterniond turn,
            int keeps_velocity);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_apply_impulse(ulong world, ulong body, ref Vector3d impulse, int[] vertices,
            UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_apply_force(ulong world, ulong body, ref Vector3d force, int[] vertices,
            UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_impulse_at(ulong world, ulong body, ref Vector3d impulse, ref Vector3d point,
            double radius);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_gravity_scale(ulong world, ulong body, double scale);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_friction(ulong world, ulong body, double friction);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_damping(ulong world, ulong body, double rate);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_sheltered(ulong world, ulong body, int is_sheltered);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_pin(ulong world, ulong body, int[] vertices, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_unpin(ulong world, ulong body, int[] vertices, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_targets(ulong world, ulong body, int[] vertices, UIntPtr count,
            float[] targets);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_attach(ulong world, ulong body, int[] vertices, UIntPtr count, int frame,
            int feels);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_detach(ulong world, ulong body, int[] vertices, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_break_force(ulong world, ulong body, int frame, double force);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_get_load(ulong world, ulong body, int frame, out Vector3d force,
            out Vector3d torque);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_grab(ulong world, ulong body, ref Pull pull, out ulong grab);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_get_grab(ulong world, int number, out ulong grab);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_grab_move(ulong world, ulong grab, ref Vector3d point);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_grab_release(ulong world, ulong grab);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_grab_get_force(ulong world, ulong grab, out Vector3d force);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_join(ulong world, ulong body, int[] vertices, UIntPtr count, ulong other,
            int[] onto, out ulong joint);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_connect(ulong world, ulong body, ulong other, int kind, ref Vector3d anchor,
            ref Vector3d axis, out ulong joint);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_get_joint(ulong world, int number, out ulong joint);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_joint_release(ulong world, ulong joint);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_joint_set_break_force(ulong world, ulong joint, double force);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_joint_get_force(ulong world, ulong joint, out Vector3d force);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_add_motor(ulong world, ulong body, int[] vertices, UIntPtr count,
            ref Drive drive, out ulong motor);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_get_motor(ulong world, int number, out ulong motor);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_motor_set_speed(ulong world, ulong motor, double speed);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_motor_set_limit(ulong world, ulong motor, double limit);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_motor_remove(ulong world, ulong motor);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_motor_get_speed(ulong world, ulong motor, out double speed);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_motor_get_effort(ulong world, ulong motor, out double effort);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_raycast(ulong world, ref Vector3d origin, ref Vector3d direction,
            double reach, ref Hit hit);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_closest(ulong world, ref Vector3d point, double reach, ref Hit hit);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_cast(ulong world, ref Cast cast, ref Touch touch);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_nearest(ulong world, ref Vector3d point, double reach, int targets, int mask,
            ref Touch touch);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_overlap_sphere(ulong world, ref Vector3d center, double radius,
            ulong[] bodies, UIntPtr capacity, out UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_overlap_box(ulong world, ref Pose pose, ref Vector3d size, ulong[] bodies,
            UIntPtr capacity, out UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_add(ulong world, ref Shape shape, ref Pose pose, out int collider);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_sensor_add(ulong world, ref Shape shape, ref Pose pose, out int sensor);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_sensor_get_bodies(ulong world, int sensor, ulong[] bodies, UIntPtr capacity,
            out UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_remove(ulong world, int collider);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_move_to(ulong world, int collider, ref Pose pose);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_set_velocity(ulong world, int collider, ref Vector3d linear,
            ref Vector3d spin);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_enabled(ulong world, ulong body, int is_enabled);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_filter(ulong world, ulong body, int group, int mask);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_set_filter(ulong world, int collider, int group, int mask);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_set_surface_velocity(ulong world, int collider, ref Vector3d velocity);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_teleport(ulong world, int collider, ref Pose pose);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_set_friction(ulong world, int collider, double friction);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_get_pose(ulong world, int collider, out Pose pose);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_get_impulse(ulong world, int collider, out Vector3d impulse,
            out Vector3d moment);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_frame_add(ulong world, ref Pose pose, out int frame);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_frame_remove(ulong world, int frame);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_frame_move_to(ulong world, int frame, ref Pose pose);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_frame_get_pose(ulong world, int frame, out Pose pose);
    }
}
